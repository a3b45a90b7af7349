// What tests kill and stop: commits sessions, stages scans and collects garbage until it is killed or done. Writes the
// number of each session to standard output once it is acknowledged.
//
//   crash_worker DIRECTORY FIRST END                 on RocksDB, from two threads
//   crash_worker power DIRECTORY FIRST WRITES SEED   on RocksDB, until the power fails at that write; acknowledges
//                                                    kReachedStates * session + how far it has come
//   crash_worker CEPH_CONF NAMESPACE HOLDER END      on RADOS, beside others, under leases of a fifth of a second

#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "storage/collector.h"
#include "storage/leases.h"
#include "storage/rados_engine.h"
#include "storage/rocksdb_engine.h"
#include "storage/session_store.h"
#include "tests/unit/storage/counting_session.h"
#include "tests/unit/storage/power_loss_env.h"

namespace mapkeep {
namespace {

constexpr double kLeaseSeconds = 0.2;
constexpr int kMostPasses = 100'000;

const MapStoreOptions kHasty{.intent_seconds = 0.01, .pin_seconds = 5};

void Require(const absl::Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "%s\n", status.ToString().c_str());
  std::abort();
}

void Acknowledge(int number) {
  const std::string line = std::to_string(number) + "\n";
  if (::write(STDOUT_FILENO, line.data(), line.size()) < 0) std::abort();
}

void RunOnRocksDb(const std::string& directory, int first, int end) {
  auto engine = OpenRocksDbEngine(directory);
  Require(engine.status());
  const auto maps = OpenMapStore(**engine, kHasty);
  const auto sessions = OpenSessionStore(**engine, kCountingLargeBatch);
  const absl::Status made = maps->Create({.name = "m"}).status();
  if (!absl::IsAlreadyExists(made)) Require(made);
  std::vector<std::thread> threads;
  for (int t = 0; t < 2; ++t) {
    threads.emplace_back([&, t] {
      for (int number = first + t; number < end; number += 2) {
        Require(RunCountingSession(*maps, *sessions, number, 0, [](Reached) {}));
        Acknowledge(number);
        if (number % 4 == 0) Require(CollectGarbage(**engine, {.keep_epochs = 3, .grace_seconds = 0}).status());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
}

void RunUntilPowerFails(const std::string& directory, int first, int writes, uint64_t seed) {
  PowerLossEnv env(writes, seed);
  const auto engine = OpenRocksDbEngine(directory, {.env = &env, .write_buffer_bytes = size_t{1} << 18});
  Require(engine.status());
  const auto maps = OpenMapStore(**engine, {});
  const absl::Status made = maps->Create({.name = "m"}).status();
  if (!absl::IsAlreadyExists(made)) Require(made);
  const auto sessions = OpenSessionStore(**engine, kCountingLargeBatch);
  for (int number = first; number < kMostPasses; ++number) {
    Require(RunCountingSession(*maps, *sessions, number, 0, [number](Reached so_far) {
      Acknowledge(kReachedStates * number + static_cast<int>(so_far));
    }));
    if (number % 5 == 0) Require(CollectGarbage(**engine, {.keep_epochs = 3, .grace_seconds = 0}).status());
  }
}

// What a worker finds that slept past its lease: another one has moved the session on meanwhile.
bool IsPassedBy(const absl::Status& status) {
  return absl::IsAborted(status) || absl::IsFailedPrecondition(status) || absl::IsOutOfRange(status) ||
         absl::IsNotFound(status);
}

// Every session that nobody else has a lease on, until all are committed.
void RunOnRados(const std::string& conf, const std::string& name_space, const std::string& holder, int end) {
  auto engine = OpenRadosEngine({.conf = conf, .pool = "maps", .name_space = name_space});
  Require(engine.status());
  const auto maps = OpenMapStore(**engine, kHasty);
  const auto sessions = OpenSessionStore(**engine, kCountingLargeBatch);
  const auto leases = OpenLeases(**engine);
  std::set<int> open;
  for (int number = 0; number < end; ++number) open.insert(number);
  for (int pass = 0; pass < kMostPasses && !open.empty(); ++pass) {
    for (auto next = open.begin(); next != open.end();) {
      const int number = *next;
      const auto lease = leases->Acquire("m", std::to_string(number), holder, kLeaseSeconds);
      absl::Status status = lease.status();
      if (status.ok()) {
        status = RunCountingSession(*maps, *sessions, number, lease->fence, [](Reached) {});
        leases->Release(*lease).IgnoreError();
      }
      if (!status.ok() && !IsPassedBy(status)) Require(status);
      next = status.ok() ? open.erase(next) : std::next(next);
      if (status.ok()) Acknowledge(number);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

}  // namespace
}  // namespace mapkeep

int main(int argc, char** argv) {
  if (argc == 4) mapkeep::RunOnRocksDb(argv[1], std::atoi(argv[2]), std::atoi(argv[3]));
  if (argc == 6) {
    mapkeep::RunUntilPowerFails(argv[2], std::atoi(argv[3]), std::atoi(argv[4]), std::strtoull(argv[5], nullptr, 10));
  }
  if (argc == 5) mapkeep::RunOnRados(argv[1], argv[2], argv[3], std::atoi(argv[4]));
  return argc >= 4 && argc <= 6 ? 0 : 2;
}
