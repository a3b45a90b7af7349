// kill -9 at random moments of staging, committing and collecting: every acknowledged session is applied exactly once,
// every other one at most once, and nothing is damaged.

#include <gmock/gmock.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <set>
#include <string>

#include "storage/collector.h"
#include "storage/session_store.h"
#include "tests/unit/storage/counting_map.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

constexpr int kSessionsARound = 200;  ///< more than a round lives to see

/// A running crash_worker.
class Worker final {
 public:
  Worker(const std::string& directory, int first, int end) {
    const std::string program =
        (std::filesystem::read_symlink("/proc/self/exe").parent_path() / "crash_worker").string();
    std::array<int, 2> ends{};
    EXPECT_EQ(::pipe(ends.data()), 0);
    output_ = ends[0];
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_addclose(&actions, ends[0]);
    posix_spawn_file_actions_addclose(&actions, ends[1]);
    std::array<std::string, 4> words = {program, directory, std::to_string(first), std::to_string(end)};
    std::array<char*, 5> arguments = {words[0].data(), words[1].data(), words[2].data(), words[3].data(), nullptr};
    EXPECT_EQ(::posix_spawn(&process_, program.c_str(), &actions, nullptr, arguments.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    ::close(ends[1]);
  }
  ~Worker() { ::close(output_); }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// The next session acknowledged, or nothing when the worker has ended.
  std::optional<int> NextAcknowledged() {
    std::string line;
    char byte = 0;
    while (::read(output_, &byte, 1) == 1) {
      if (byte == '\n') return std::stoi(line);
      line.push_back(byte);
    }
    return std::nullopt;
  }

  void Kill() { ::kill(process_, SIGKILL); }

  /// The exit status, as waitpid gives it.
  int Wait() {
    int status = 0;
    EXPECT_EQ(::waitpid(process_, &status, 0), process_);
    return status;
  }

 private:
  pid_t process_ = 0;
  int output_ = -1;
};

/// The sessions that the map says are applied; checks that it reads whole and counts each of them once.
std::set<int> AppliedIn(const std::string& directory, uint64_t& incarnation) {
  const auto engine = OpenRocksDbEngine(directory);
  EXPECT_DONE(engine);
  const auto maps = OpenMapStore(**engine, {});
  const auto map = maps->Find("m");
  if (absl::IsNotFound(map.status())) return {};
  EXPECT_DONE(map);
  incarnation = map->incarnation;
  std::set<int> applied;
  EXPECT_DONE((*engine)->Scan(HeadPartition(incarnation), "applied/", "applied0",
                              [&applied](std::string_view key, std::string_view) {
                                applied.insert(std::stoi(std::string(key.substr(8))));
                                return true;
                              }));
  ExpectCounted(*maps, applied);
  CheckMap(**engine, incarnation);
  return applied;
}

TEST(Crash, EveryAcknowledgedSessionIsAppliedOnceWheneverTheProcessIsKilled) {
  const int rounds = std::getenv("MAPKEEP_LONG") != nullptr ? 200 : 6;
  std::mt19937_64 random(1);
  TemporaryDirectory directory;
  const std::string database = directory.path() + "/db";
  uint64_t incarnation = 0;
  std::set<int> acknowledged;
  int first = 0;
  for (int round = 0; round < rounds; ++round) {
    Worker worker(database, first, first + kSessionsARound);
    const size_t enough = random() % 6;
    for (size_t i = 0; i < enough; ++i) {
      const std::optional<int> session = worker.NextAcknowledged();
      ASSERT_TRUE(session) << "the worker ended by itself";
      acknowledged.insert(*session);
    }
    ::usleep(random() % 30000);  // anywhere in what comes next, not only right after an acknowledgement
    worker.Kill();
    while (const std::optional<int> session = worker.NextAcknowledged()) acknowledged.insert(*session);
    ASSERT_TRUE(WIFSIGNALED(worker.Wait()));
    const std::set<int> applied = AppliedIn(database, incarnation);
    ASSERT_TRUE(std::ranges::includes(applied, acknowledged)) << "round " << round;
    while (acknowledged.contains(first)) ++first;
  }

  // The last one may finish: what was cut off is taken up, and nothing is left behind.
  const int end = acknowledged.empty() ? 10 : *acknowledged.rbegin() + 10;
  Worker worker(database, 0, end);
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
