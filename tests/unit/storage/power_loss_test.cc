// Power that fails at a random write, and with it everything that was not synced: every acknowledged scan and session
// is there, each session merged exactly once, and the map is whole.

#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <random>
#include <set>

#include "storage/collector.h"
#include "tests/unit/storage/counting_session.h"
#include "tests/unit/storage/power_loss_env.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

constexpr int kMostSessions = 100'000;

/// Runs sessions from `first` on until the power fails; notes how far each was acknowledged.
void RunUntilPowerFails(const std::string& database, PowerLossEnv& env, int first, std::map<int, Reached>& reached) {
  const auto engine = OpenRocksDbEngine(database, {.env = &env, .write_buffer_bytes = size_t{1} << 18});
  if (!engine.ok()) return;
  const auto maps = OpenMapStore(**engine, {});
  if (const absl::Status made = maps->Create({.name = "m"}).status(); !made.ok() && !absl::IsAlreadyExists(made))
    return;
  const auto sessions = OpenSessionStore(**engine, kCountingLargeBatch);
  for (int number = first; !env.has_failed() && number < kMostSessions; ++number) {
    RunCountingSession(*maps, *sessions, number, 0, [&](Reached so_far) {
      reached[number] = std::max(reached[number], so_far);
    }).IgnoreError();
    if (number % 5 == 0) CollectGarbage(**engine, {.keep_epochs = 3, .grace_seconds = 0}).IgnoreError();
  }
}

TEST(PowerLoss, EveryAcknowledgedSessionIsThereOnceWheneverThePowerFails) {
  const int rounds = std::getenv("MAPKEEP_LONG") != nullptr ? 100 : 5;
  std::mt19937_64 random(11);
  const TemporaryDirectory directory;
  const std::string database = directory.path() + "/db";
  std::map<int, Reached> reached;
  for (int round = 0; round < rounds; ++round) {
    // What an earlier round was cut off at goes on; the others are found to be done.
    int first = 0;
    while (reached.contains(first) && reached.at(first) == Reached::kCommitted) ++first;
    PowerLossEnv env(60 + static_cast<int>(random() % 600));
    RunUntilPowerFails(database, env, first, reached);
    env.DropUnsynced(random);

    const auto engine = OpenRocksDbEngine(database);
    ASSERT_DONE(engine);
    const auto maps = OpenMapStore(**engine, {});
    const auto map = maps->Find("m");
    if (absl::IsNotFound(map.status()) && reached.empty()) continue;
    ASSERT_DONE(map);
    const std::set<int> applied = AppliedSessions(**engine, map->incarnation);
    const auto sessions = OpenSessionStore(**engine, kCountingLargeBatch);
    for (const auto& [number, so_far] : reached) {
      if (so_far >= Reached::kApplied) {
        ASSERT_TRUE(applied.contains(number)) << "round " << round;
      }
      if (so_far > Reached::kNothing) ExpectKept(*sessions, number, so_far);
    }
    ExpectCounted(*maps, applied);
    const auto verified = maps->Verify("m");
    ASSERT_DONE(verified);
    ASSERT_THAT(verified->problems, testing::IsEmpty()) << "round " << round;
    for (const int number : applied) reached[number] = std::max(reached[number], Reached::kApplied);
  }
  EXPECT_GT(reached.size(), static_cast<size_t>(rounds));
}

}  // namespace
}  // namespace mapkeep
