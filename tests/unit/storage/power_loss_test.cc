// Power that fails at a random write, and with it everything that was not synced: every acknowledged scan and session
// is there, each session merged exactly once, and the map is whole.

#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <string>

#include "tests/unit/storage/counting_session.h"
#include "tests/unit/storage/test_engine.h"
#include "tests/unit/storage/worker_process.h"

namespace mapkeep {
namespace {

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
    const uint64_t writes = 60 + random() % 600;
    WorkerProcess worker({"power", database, std::to_string(first), std::to_string(writes), std::to_string(random())});
    while (const std::optional<int> acknowledged = worker.NextAcknowledged()) {
      Reached& so_far = reached[*acknowledged / kReachedStates];
      so_far = std::max(so_far, Reached{*acknowledged % kReachedStates});
    }
    ASSERT_EQ(worker.Wait(), 0);

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
