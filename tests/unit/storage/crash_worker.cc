// What the crash test kills: commits sessions from two threads, stages scans and collects garbage in the directory
// given until it is killed or done. Writes the number of each session to standard output once its commit is
// acknowledged.

#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include "storage/collector.h"
#include "storage/rocksdb_engine.h"
#include "storage/session_store.h"
#include "tests/unit/storage/counting_map.h"

namespace mapkeep {
namespace {

void Require(const absl::Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "%s\n", status.ToString().c_str());
  std::abort();
}

/// Stages a session's scans, commits it, drops the scans: as the server does, from wherever an earlier run was killed.
void RunSession(MapStore& maps, SessionStore& sessions, int number) {
  const std::string id = std::to_string(number);
  const auto begun = sessions.Begin({.map = "m", .id = id, .scan_crc32c = {1, 2, 3}});
  Require(begun.status());
  SessionRecord record = *begun;
  StagedScan scan;
  scan.scan.points.assign(2000, Eigen::Vector3f(1, 2, static_cast<float>(number)));
  if (record.state == SessionState::kUploading) {
    for (uint32_t i = record.durable_scans; i < 3; ++i) Require(sessions.AppendScans("m", id, i, {&scan, 1}));
    record.state = SessionState::kRunning;
    Require(sessions.Update(record, SessionState::kUploading));
  }
  if (record.state == SessionState::kRunning) {
    const auto applied = maps.FindCommit("m", id);
    Require(applied.status());
    if (!applied->has_value()) Require(sessions.ReadScan("m", id, 2).status());
    Require(maps.Commit("m", CountingRequest(number)).status());
    Require(sessions.DeleteScans("m", id));
    record.state = SessionState::kCommitted;
    Require(sessions.Update(record, SessionState::kRunning));
  }
  const std::string line = id + "\n";
  if (::write(STDOUT_FILENO, line.data(), line.size()) < 0) std::abort();
}

void Run(const std::string& directory, int first, int end) {
  auto engine = OpenRocksDbEngine(directory);
  Require(engine.status());
  const auto maps = OpenMapStore(**engine, {.intent_seconds = 0.01, .pin_seconds = 5});
  const auto sessions = OpenSessionStore(**engine);
  const absl::Status made = maps->Create({.name = "m"}).status();
  if (!absl::IsAlreadyExists(made)) Require(made);
  std::vector<std::thread> threads;
  for (int t = 0; t < 2; ++t) {
    threads.emplace_back([&, t] {
      for (int number = first + t; number < end; number += 2) {
        RunSession(*maps, *sessions, number);
        if (number % 4 == 0) Require(CollectGarbage(**engine, {.keep_epochs = 3, .grace_seconds = 0}).status());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
}

}  // namespace
}  // namespace mapkeep

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  mapkeep::Run(argv[1], std::atoi(argv[2]), std::atoi(argv[3]));
  return 0;
}
