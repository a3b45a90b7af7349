// The engine on a real RADOS cluster on loopback, which this program starts and stops (tests/rados_cluster). The
// cluster is shared by the tests; each has a namespace of its own.

#include "storage/rados_engine.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <random>
#include <set>
#include <string>
#include <thread>

#include "storage/collector.h"
#include "storage/leases.h"
#include "storage/map_copy.h"
#include "tests/unit/storage/counting_session.h"
#include "tests/unit/storage/engine_conformance.h"
#include "tests/unit/storage/worker_process.h"

namespace mapkeep {
namespace {

/// Starts the cluster before the first test and stops it after the last one.
class Cluster final : public testing::Environment {
 public:
  void SetUp() override {
    directory_ = std::make_unique<TemporaryDirectory>();
    ASSERT_EQ(Run("up"), 0);
  }
  void TearDown() override {
    EXPECT_EQ(Run("down"), 0);
    directory_.reset();
  }

  int Run(const std::string& command) {
    return std::system((MAPKEEP_RADOS_CLUSTER " " + command + " " + directory_->path() + "/ceph").c_str());
  }
  std::string conf() const { return directory_->path() + "/ceph/ceph.conf"; }
  /// Of a user who may use the pool and nothing else.
  std::string keyring() const { return directory_->path() + "/ceph/client.maps.keyring"; }

 private:
  std::unique_ptr<TemporaryDirectory> directory_;
};

Cluster* cluster() {
  static auto* const started = dynamic_cast<Cluster*>(testing::AddGlobalTestEnvironment(new Cluster));
  return started;
}
const Cluster* const kStarted = cluster();

EngineKind RadosKind() {
  return {"Rados",
          [](const std::string& directory) {
            return OpenRadosEngine({.conf = cluster()->conf(),
                                    .pool = "maps",
                                    .name_space = directory,
                                    .user = "maps",
                                    .keyring = cluster()->keyring()});
          },
          false};
}

INSTANTIATE_TEST_SUITE_P(Engines, EngineTest, testing::Values(RadosKind()),
                         [](const auto& kind) { return kind.param.name; });

TEST(RadosEngine, APoolThatIsNotThereIsNamed) {
  const absl::Status missing = OpenRadosEngine({.conf = cluster()->conf(), .pool = "elsewhere"}).status();
  EXPECT_CODE(missing, kNotFound);
  EXPECT_THAT(std::string(missing.message()), testing::HasSubstr("elsewhere"));
}

TEST(RadosEngine, AUserWithoutTheRightKeyIsRefused) {
  const TemporaryDirectory directory;
  const std::string forged = directory.path() + "/keyring";
  std::ofstream(forged) << "[client.maps]\n\tkey = AQD4fPdlAAAAABAAvYQ7nlT2vmVnUyyWXRAYmQ==\n";
  const absl::Status refused =
      OpenRadosEngine({.conf = cluster()->conf(), .pool = "maps", .user = "maps", .keyring = forged}).status();
  EXPECT_CODE(refused, kPermissionDenied);
  EXPECT_THAT(std::string(refused.message()), testing::HasSubstr("client.maps"));
}

TEST(RadosEngine, MapsAreCommittedCollectedAndRolledBackOnIt) {
  TestEngine engine(RadosKind());
  const auto maps = OpenMapStore(*engine, {});
  const auto made = maps->Create({.name = "m"});
  ASSERT_DONE(made);
  std::set<int> sessions;
  for (int session = 0; session < 12; ++session) {
    ASSERT_DONE(maps->Commit("m", CountingRequest(session)));
    sessions.insert(session);
  }
  ExpectCounted(*maps, sessions);
  ASSERT_DONE(maps->AddTag("m", "t", 5));
  ASSERT_DONE(CollectGarbage(*engine, {.keep_epochs = 2, .grace_seconds = 0}));
  EXPECT_EQ((*maps->Open("m", 5))->sessions(), 5U);
  ASSERT_DONE(maps->Rollback("m", 5));
  EXPECT_EQ((*maps->Open("m"))->sessions(), 5U);
  const auto verified = maps->Verify("m");
  ASSERT_DONE(verified);
  EXPECT_THAT(verified->problems, testing::IsEmpty());
}

TEST(RadosEngine, TwoDaemonsThatCommitToOneMapMergeNothingTwiceAndLoseNothing) {
  TestEngine first(RadosKind());
  const auto second = RadosKind().open(first.path());
  ASSERT_DONE(second);
  const auto a = OpenMapStore(*first, {});
  const auto b = OpenMapStore(**second, {});
  ASSERT_DONE(a->Create({.name = "m"}));
  constexpr int kSessions = 40;  // each by both: whoever comes second finds it applied
  const auto run = [&](MapStore& maps, bool backwards) {
    for (int i = 0; i < kSessions; ++i) {
      EXPECT_DONE(maps.Commit("m", CountingRequest(backwards ? kSessions - 1 - i : i)));
    }
  };
  std::thread other([&] { run(*b, true); });
  run(*a, false);
  other.join();
  std::set<int> sessions;
  for (int i = 0; i < kSessions; ++i) sessions.insert(i);
  ExpectCounted(*a, sessions);
}

TEST(RadosEngine, ALeaseOfADaemonThatDiedIsTakenOverByAnother) {
  TestEngine first(RadosKind());
  const auto second = RadosKind().open(first.path());
  ASSERT_DONE(second);
  ASSERT_DONE(OpenMapStore(*first, {})->Create({.name = "m"}));
  double now = 1e9;
  Leases a(*first, [&] { return now; }), b(**second, [&] { return now; });
  const auto held = a.Acquire("m", "s", "a", 10);
  ASSERT_DONE(held);
  EXPECT_CODE(b.Acquire("m", "s", "b", 10), kAborted);
  now += 11;
  const auto taken = b.Acquire("m", "s", "b", 10);
  ASSERT_DONE(taken);
  EXPECT_GT(taken->fence, held->fence);
  EXPECT_CODE(a.Renew(*held, 10), kAborted);
  CommitRequest late = CountingRequest(1);
  late.session = "s";
  late.lease_fence = held->fence;
  EXPECT_CODE(OpenMapStore(*first, {})->Commit("m", late), kAborted);
}

/// Two processes on one map; one is stopped past its leases while the garbage of whoever seems dead is collected, and
/// goes on. Whatever it was at: nothing is merged twice, nothing is lost, nothing is left behind.
TEST(RadosEngine, AWorkerThatIsStoppedPastItsLeaseWhileItsAttemptIsCollectedDoublesNothing) {
  const bool is_long = std::getenv("MAPKEEP_LONG") != nullptr;
  const int sessions = is_long ? 1500 : 40;
  TestEngine engine(RadosKind());
  uint64_t incarnation = 0;
  {
    const auto maps = OpenMapStore(*engine, {});
    incarnation = maps->Create({.name = "m"})->incarnation;
    const std::string end = std::to_string(sessions);
    WorkerProcess a({cluster()->conf(), engine.path(), "a", end}), b({cluster()->conf(), engine.path(), "b", end});
    std::mt19937_64 random(5);
    uint64_t attempts = 0;
    int stops = 0;
    while (AppliedSessions(*engine, incarnation).size() < static_cast<size_t>(sessions)) {
      WorkerProcess& stopped = stops % 2 == 0 ? a : b;
      ::usleep(random() % 60'000);
      stopped.Signal(SIGSTOP);
      ::usleep(250'000);  // past leases and intents
      const auto counts = CollectGarbage(*engine, {.keep_epochs = 3, .grace_seconds = 0});
      stopped.Signal(SIGCONT);
      ASSERT_DONE(counts);
      attempts += counts->attempts;
      ASSERT_LT(++stops, 100 * sessions);
    }
    EXPECT_EQ(a.Wait(), 0);
    EXPECT_EQ(b.Wait(), 0);
    std::set<int> all;
    for (int session = 0; session < sessions; ++session) all.insert(session);
    ExpectCounted(*maps, all);
    std::printf("%d stops, %d attempts collected under their committers\n", stops, static_cast<int>(attempts));
  }
  ASSERT_DONE(CollectGarbage(*engine, {.keep_epochs = 1, .now = [] { return SystemSeconds() + 1e6; }}));
  EXPECT_EQ(CheckMap(*engine, incarnation), 0U);
}

TEST(RadosEngine, AnOsdThatIsKilledUnderLoadCostsNoCommitAndDoublesNone) {
  TestEngine engine(RadosKind());
  const auto maps = OpenMapStore(*engine, {});
  ASSERT_DONE(maps->Create({.name = "m"}));
  std::set<int> sessions;
  for (int session = 0; session < 40; ++session) {
    if (session == 10) {
      EXPECT_EQ(cluster()->Run("kill-osd"), 0);
    }
    if (session == 30) {
      EXPECT_EQ(cluster()->Run("start-osd"), 0);
    }
    ASSERT_DONE(maps->Commit("m", CountingRequest(session)));
    sessions.insert(session);
  }
  ExpectCounted(*maps, sessions);
  EXPECT_THAT(maps->Verify("m")->problems, testing::IsEmpty());
}

TEST(RadosEngine, AMapIsCopiedToRocksDbAsOfOneEpoch) {
  TestEngine pool(RadosKind());
  const auto maps = OpenMapStore(*pool, {});
  ASSERT_DONE(maps->Create({.name = "m"}));
  for (int session = 0; session < 6; ++session) ASSERT_DONE(maps->Commit("m", CountingRequest(session)));
  TestEngine copy;
  const auto snapshot = maps->Open("m", 4);
  ASSERT_DONE(CopyMap(*pool, *copy, "m", "copy", 4));
  const auto copied = OpenMapStore(*copy, {});
  EXPECT_EQ((*copied->Open("copy"))->totals(), (*snapshot)->totals());
  EXPECT_THAT(copied->Verify("copy")->problems, testing::IsEmpty());
}

}  // namespace
}  // namespace mapkeep
