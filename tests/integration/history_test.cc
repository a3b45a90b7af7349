// Epochs, upkeep and kills, through a real daemon.

#include <gmock/gmock.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "tests/integration/daemon_process.h"
#include "tests/integration/rados_cluster.h"
#include "tests/integration/robot.h"
#include "tests/integration/status_matchers.h"
#include "tests/integration/upkeep.h"

namespace mapkeep {
namespace {

using ::testing::ElementsAre;

constexpr double kStart = 1.79e9;  // seconds since 1970

const bool kLong = std::getenv("MAPKEEP_LONG") != nullptr;

std::string Id(char robot, int number) { return std::string(1, robot).append(std::to_string(number)); }

Drive ShortDrive(int number) { return DriveAlong(Street(), 16, kStart + 3600.0 * number); }

void Merge(Robot& robot, const std::string& id, int number) {
  ASSERT_THAT(robot.UploadDrive("street", id, ShortDrive(number), true), IsOk());
  ASSERT_EQ(robot.Watch("street", id).state(), v1::SESSION_STATE_COMMITTED);
}

TEST(History, AMapThatIsRolledBackIsWhatItWasAndItsLaterSessionsSaySo) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  Merge(robot, "day-1", 1);
  const std::string before = BytesOf(robot.Tiles("street", true));
  Merge(robot, "day-2", 2);
  EXPECT_NE(BytesOf(robot.Tiles("street", true)), before);

  v1::RollBackMapRequest back;
  back.set_map("street");
  back.set_epoch(1);
  v1::RollBackMapResponse rolled;
  ASSERT_THAT(robot.maps().RollBackMap(Robot::Call().get(), back, &rolled), IsOk());
  EXPECT_EQ(rolled.epoch(), 3U);
  EXPECT_THAT(rolled.rolled_back(), ElementsAre("day-2"));
  EXPECT_EQ(BytesOf(robot.Tiles("street", true)), before);
  v1::Session session;
  ASSERT_THAT(robot.GetSession("street", "day-2", session), IsOk());
  EXPECT_EQ(session.state(), v1::SESSION_STATE_ROLLED_BACK);

  v1::ListVersionsRequest request;
  request.set_map("street");
  request.set_page_size(3);
  v1::ListVersionsResponse versions;
  ASSERT_THAT(robot.maps().ListVersions(Robot::Call().get(), request, &versions), IsOk());
  ASSERT_EQ(versions.versions_size(), 3);
  EXPECT_TRUE(versions.versions(0).rollback());
  EXPECT_EQ(versions.versions(1).session(), "day-2");
  EXPECT_FALSE(versions.next_page_token().empty());

  EXPECT_EQ(Verify(robot, "street").problem_count(), 0U);
  const v1::ReplayMapResponse replay = Replay(robot, "street");
  EXPECT_EQ(replay.commits(), 3U);
  EXPECT_GT(replay.blocks(), 0U);
  EXPECT_EQ(replay.different(), 0U) << replay.first_difference();
}

TEST(History, ABackupMadeWhileServingIsRestoredUnderAnotherName) {
  const DaemonProcess daemon;
  const TemporaryDirectory directory;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  Merge(robot, "day-1", 1);
  v1::BackupRequest backup;
  backup.set_directory(directory.path() + "/backup");
  v1::BackupResponse made;
  ASSERT_THAT(robot.admin().Backup(Robot::Call().get(), backup, &made), IsOk());
  EXPECT_THAT(made.maps(), ElementsAre("street"));
  v1::RestoreRequest restore;
  restore.set_directory(backup.directory());
  v1::RestoreResponse restored;
  EXPECT_EQ(robot.admin().Restore(Robot::Call().get(), restore, &restored).error_code(),
            grpc::StatusCode::ALREADY_EXISTS);
  restore.set_map("street");
  restore.set_as("copy");
  ASSERT_THAT(robot.admin().Restore(Robot::Call().get(), restore, &restored), IsOk());
  EXPECT_EQ(BytesOf(robot.Tiles("copy", true)), BytesOf(robot.Tiles("street", true)));
  EXPECT_EQ(Verify(robot, "copy").problem_count(), 0U);
}

// Drives whose areas overlap by half.
void DriveOverlapping(const std::string& address, char name, int sessions) {
  Robot robot(address);
  for (int i = 0; i < sessions; ++i) {
    const double along = -6.0 + 3.0 * (i % 5) + (name == 'a' ? 0 : 1.5);
    const Drive drive = DriveAlong(Street(), 16, kStart + 3600.0 * (2 * i + (name == 'a' ? 0 : 1)), {0, 0, 0}, along);
    EXPECT_THAT(robot.UploadDrive("street", Id(name, i), drive, true), IsOk());
  }
}

void WaitForSessions(Robot& robot, uint64_t sessions) {
  v1::Map map;
  for (int glance = 0; glance < 60000 && map.sessions() < sessions; ++glance) {
    ::usleep(20000);
    ASSERT_THAT(robot.GetMap("street", map), IsOk());
  }
}

TEST(History, OnOnePoolDaemonsAndAnOsdThatDieOrSleepUnderLoadCostNoSessionAndDoubleNone) {
  const RadosCluster cluster;
  DaemonProcess first(cluster.Flags());
  const DaemonProcess second(cluster.Flags());
  Robot b(second.listen());
  ASSERT_THAT(Robot(first.listen()).CreateMap("street"), IsOk());
  const int sessions = kLong ? 100 : 4;  // of each daemon
  {
    std::jthread to_first([&] { DriveOverlapping(first.listen(), 'a', sessions); });
    const std::jthread to_second([&] { DriveOverlapping(second.listen(), 'b', sessions); });
    WaitForSessions(b, static_cast<uint64_t>(sessions) / 4);
    ASSERT_EQ(cluster.Run("kill-osd"), 0);
    WaitForSessions(b, static_cast<uint64_t>(sessions) / 2);
    // Past its leases, while the other one commits and collects.
    first.Signal(SIGSTOP);
    ::usleep(5000000);
    v1::CollectGarbageResponse collected;
    EXPECT_THAT(b.admin().CollectGarbage(Robot::Call().get(), {}, &collected), IsOk());
    first.Signal(SIGCONT);
    to_first.join();  // what it has acknowledged is the other one's once it is dead
    first.Kill();
  }
  v1::Map map;
  ASSERT_THAT(b.GetMap("street", map), IsOk());
  std::printf("%d of %d sessions were merged when the daemon was killed\n", static_cast<int>(map.sessions()),
              2 * sessions);
  for (int i = 0; i < sessions; ++i) {
    for (const char robot : {'a', 'b'}) {
      const v1::Session session = b.Watch("street", Id(robot, i));
      EXPECT_EQ(session.state(), v1::SESSION_STATE_COMMITTED) << session.id() << ": " << session.reason();
    }
  }
  ExpectWhole(b, "street", 2 * static_cast<uint64_t>(sessions));
}

TEST(History, SerialDaemonsOnOnePoolMergeInTheOrderOfCommitSession) {
  const RadosCluster cluster;
  const std::vector<std::string> flags = cluster.Flags("serial_per_map = true");
  const DaemonProcess first(flags), second(flags);
  Robot a(first.listen()), b(second.listen());
  ASSERT_THAT(a.CreateMap("street"), IsOk());
  constexpr int kSessions = 6;
  std::vector<std::string> order;
  for (int i = 0; i < kSessions; ++i) {
    const std::vector<WireScan> scans = Wire(ShortDrive(i));
    Robot& robot = i % 2 == 0 ? a : b;
    ASSERT_THAT(robot.Begin("street", Id('s', i), scans), IsOk());
    ASSERT_THAT(robot.Send("street", Id('s', i), scans), IsOk());
  }
  for (const int i : {4, 1, 0, 3, 2, 5}) {
    ASSERT_THAT((i % 2 == 0 ? a : b).Commit("street", Id('s', i)), IsOk());
    order.push_back(Id('s', i));
  }
  for (const std::string& id : order) {
    Robot& robot = (id.back() - '0') % 2 == 0 ? a : b;
    EXPECT_EQ(robot.Watch("street", id).state(), v1::SESSION_STATE_COMMITTED) << id;
  }
  EXPECT_EQ(SessionsOf(a, "street"), order);
}

}  // namespace
}  // namespace mapkeep
