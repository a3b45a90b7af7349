// Power that fails at a random write, and with it everything that was not synced: every acknowledged session is there
// exactly once, and the map is whole.

#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <set>

#include "storage/collector.h"
#include "tests/unit/storage/counting_map.h"
#include "tests/unit/storage/power_loss_env.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

/// Commits sessions from `first` on until the power fails; adds the acknowledged ones.
void CommitUntilPowerFails(const std::string& database, PowerLossEnv& env, int first, std::set<int>& acknowledged) {
  const auto engine = OpenRocksDbEngine(database, {.env = &env, .write_buffer_bytes = size_t{1} << 18});
  if (!engine.ok()) return;
  const auto maps = OpenMapStore(**engine, {});
  if (const absl::Status made = maps->Create({.name = "m"}).status(); !made.ok() && !absl::IsAlreadyExists(made))
    return;
  for (int session = first; !env.has_failed(); ++session) {
    if (maps->Commit("m", CountingRequest(session)).ok()) acknowledged.insert(session);
    if (session % 5 == 0) CollectGarbage(**engine, {.keep_epochs = 3, .grace_seconds = 0}).IgnoreError();
  }
}

TEST(PowerLoss, EveryAcknowledgedSessionIsThereOnceWheneverThePowerFails) {
  const int rounds = std::getenv("MAPKEEP_LONG") != nullptr ? 100 : 4;
  std::mt19937_64 random(11);
  const TemporaryDirectory directory;
  const std::string database = directory.path() + "/db";
  std::set<int> acknowledged;
  for (int round = 0; round < rounds; ++round) {
    const int first = acknowledged.empty() ? 0 : *acknowledged.rbegin() + 1;
    PowerLossEnv env(60 + static_cast<int>(random() % 400));
    CommitUntilPowerFails(database, env, first, acknowledged);
    env.DropUnsynced();

    const auto engine = OpenRocksDbEngine(database);
    ASSERT_DONE(engine);
    const auto maps = OpenMapStore(**engine, {});
    const auto map = maps->Find("m");
    if (absl::IsNotFound(map.status()) && acknowledged.empty()) continue;
    ASSERT_DONE(map);
    std::set<int> applied;
    ASSERT_DONE((*engine)->Scan(HeadPartition(map->incarnation), "applied/", "applied0",
                                [&applied](std::string_view key, std::string_view) {
                                  applied.insert(std::stoi(std::string(key.substr(8))));
                                  return true;
                                }));
    ASSERT_TRUE(std::ranges::includes(applied, acknowledged)) << "round " << round;
    ExpectCounted(*maps, applied);
    const auto verified = maps->Verify("m");
    ASSERT_DONE(verified);
    ASSERT_THAT(verified->problems, testing::IsEmpty()) << "round " << round;
    acknowledged = applied;  // what came through without an answer counts from now on
  }
  EXPECT_GT(acknowledged.size(), static_cast<size_t>(rounds));
}

}  // namespace
}  // namespace mapkeep
