// kill -9 at random moments of staging, committing and collecting: every acknowledged session is applied exactly once,
// every other one at most once, and nothing is damaged.

#include <gmock/gmock.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <random>
#include <set>
#include <string>

#include "storage/collector.h"
#include "storage/session_store.h"
#include "tests/unit/storage/counting_session.h"
#include "tests/unit/storage/test_engine.h"
#include "tests/unit/storage/worker_process.h"

namespace mapkeep {
namespace {

constexpr int kSessionsARound = 200;  ///< more than a round lives to see

/// The sessions that the map says are applied; checks that it reads whole and counts each of them once.
std::set<int> AppliedIn(const std::string& directory, uint64_t& incarnation) {
  const auto engine = OpenRocksDbEngine(directory);
  EXPECT_DONE(engine);
  const auto maps = OpenMapStore(**engine, {});
  const auto map = maps->Find("m");
  if (absl::IsNotFound(map.status())) return {};
  EXPECT_DONE(map);
  incarnation = map->incarnation;
  const std::set<int> applied = AppliedSessions(**engine, incarnation);
  ExpectCounted(*maps, applied);
  CheckMap(**engine, incarnation);
  return applied;
}

TEST(Crash, EveryAcknowledgedSessionIsAppliedOnceWheneverTheProcessIsKilled) {
  const int rounds = std::getenv("MAPKEEP_LONG") != nullptr ? 300 : 6;
  std::mt19937_64 random(1);
  TemporaryDirectory directory;
  const std::string database = directory.path() + "/db";
  uint64_t incarnation = 0;
  std::set<int> acknowledged;
  int first = 0;
  for (int round = 0; round < rounds; ++round) {
    WorkerProcess worker({database, std::to_string(first), std::to_string(first + kSessionsARound)});
    const size_t enough = random() % 6;
    for (size_t i = 0; i < enough; ++i) {
      const std::optional<int> session = worker.NextAcknowledged();
      ASSERT_TRUE(session) << "the worker ended by itself";
      acknowledged.insert(*session);
    }
    ::usleep(random() % 30000);  // anywhere in what comes next, not only right after an acknowledgement
    worker.Signal(SIGKILL);
    while (const std::optional<int> session = worker.NextAcknowledged()) acknowledged.insert(*session);
    ASSERT_TRUE(WIFSIGNALED(worker.Wait()));
    const std::set<int> applied = AppliedIn(database, incarnation);
    ASSERT_TRUE(std::ranges::includes(applied, acknowledged)) << "round " << round;
    while (acknowledged.contains(first)) ++first;
  }

  // The last one may finish: what was cut off is taken up, and nothing is left behind.
  const int end = acknowledged.empty() ? 10 : *acknowledged.rbegin() + 10;
  WorkerProcess worker({database, "0", std::to_string(end)});
  while (worker.NextAcknowledged()) continue;
  EXPECT_EQ(worker.Wait(), 0);
  EXPECT_EQ(AppliedIn(database, incarnation).size(), static_cast<size_t>(end));
  const auto engine = OpenRocksDbEngine(database);
  ASSERT_DONE(engine);
  ASSERT_DONE(CollectGarbage(**engine, {.keep_epochs = 1, .now = [] { return SystemSeconds() + 1e6; }}));
  EXPECT_EQ(CheckMap(**engine, incarnation), 0U);
  const auto page = OpenSessionStore(**engine)->List("m", "", 100000);
  ASSERT_DONE(page);
  for (const SessionRecord& session : page->sessions) {
    EXPECT_EQ(session.state, SessionState::kCommitted) << session.id;
  }
}

}  // namespace
}  // namespace mapkeep
