// Epochs, upkeep and kills, through a real daemon.

#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdlib>
#include <random>

#include "tests/integration/daemon_process.h"
#include "tests/integration/rados_cluster.h"
#include "tests/integration/robot.h"
#include "tests/integration/status_matchers.h"

namespace mapkeep {
namespace {

using ::testing::ElementsAre;

constexpr double kStart = 1.79e9;  // seconds since 1970

const bool kLong = std::getenv("MAPKEEP_LONG") != nullptr;

std::string Id(char robot, int number) { return std::string(1, robot).append(std::to_string(number)); }

Drive ShortDrive(int number) { return DriveAlong(Street(), 16, kStart + 3600.0 * number); }

v1::VerifyMapResponse Verify(Robot& robot, const std::string& map) {
  v1::VerifyMapRequest request;
  request.set_map(map);
  v1::VerifyMapResponse response;
  grpc::ClientContext as_long_as_it_takes;
  EXPECT_THAT(robot.admin().VerifyMap(&as_long_as_it_takes, request, &response), IsOk());
  return response;
}

v1::ReplayMapResponse Replay(Robot& robot, const std::string& map) {
  v1::ReplayMapRequest request;
  request.set_map(map);
  v1::ReplayMapResponse response;
  grpc::ClientContext as_long_as_it_takes;
  EXPECT_THAT(robot.admin().ReplayMap(&as_long_as_it_takes, request, &response), IsOk());
  return response;
}

void Merge(Robot& robot, const std::string& id, int number) {
  ASSERT_THAT(robot.UploadDrive("street", id, ShortDrive(number), true), IsOk());
  ASSERT_EQ(robot.Watch("street", id).state(), v1::SESSION_STATE_COMMITTED);
}

// Each of the map's sessions once, nothing wrong with it, and the same again from its scans.
void ExpectWhole(Robot& robot, uint64_t sessions) {
  v1::Map map;
  ASSERT_THAT(robot.GetMap("street", map), IsOk());
  EXPECT_EQ(map.epoch(), sessions);
  EXPECT_EQ(map.sessions(), sessions);
  EXPECT_THAT(Verify(robot, "street").problems(), testing::IsEmpty());
  const v1::ReplayMapResponse replay = Replay(robot, "street");
  EXPECT_EQ(replay.commits(), sessions);
  EXPECT_EQ(replay.different(), 0U) << replay.first_difference();
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

TEST(History, WheneverTheDaemonIsKilledEveryQueuedSessionIsMergedOnceAndTheReplayAgrees) {
  const int rounds = kLong ? 300 : 3;
  std::mt19937_64 random(3);
  DaemonProcess daemon;
  ASSERT_THAT(Robot(daemon.listen()).CreateMap("street"), IsOk());
  int queued = 0;
  for (int round = 0; round < rounds; ++round) {
    {
      Robot robot(daemon.listen());
      for (uint64_t left = 1 + random() % 3; left > 0; --left, ++queued) {
        ASSERT_THAT(robot.UploadDrive("street", Id('s', queued), ShortDrive(queued), true), IsOk());
      }
      const auto scans = Wire(ShortDrive(queued));
      ASSERT_THAT(robot.Begin("street", Id('s', queued), scans, nullptr, true), IsOk());
      ::usleep(random() % 800000);
    }
    daemon.Kill();
    daemon.Start();
    Robot robot(daemon.listen());
    ASSERT_THAT(Verify(robot, "street").problems(), testing::IsEmpty()) << "round " << round;
  }
  Robot robot(daemon.listen());
  for (int number = 0; number < queued; ++number) {
    EXPECT_EQ(robot.Watch("street", Id('s', number)).state(), v1::SESSION_STATE_COMMITTED) << number;
  }
  ExpectWhole(robot, static_cast<uint64_t>(queued));
}

TEST(History, OnOnePoolADaemonThatDiesAndAnOsdThatDiesCostNoSessionAndDoubleNone) {
  const RadosCluster cluster;
  DaemonProcess first(cluster.Flags());
  const DaemonProcess second(cluster.Flags());
  Robot a(first.listen()), b(second.listen());
  ASSERT_THAT(a.CreateMap("street"), IsOk());
  const int sessions = kLong ? 100 : 4;  // of each daemon
  for (int i = 0; i < sessions; ++i) {
    ASSERT_THAT(a.UploadDrive("street", Id('a', i), ShortDrive(2 * i), true), IsOk());
    ASSERT_THAT(b.UploadDrive("street", Id('b', i), ShortDrive(2 * i + 1), true), IsOk());
    if (i == sessions / 2) {
      ASSERT_EQ(cluster.Run("kill-osd"), 0);
    }
  }
  first.Kill();
  for (int i = 0; i < sessions; ++i) {
    for (const char robot : {'a', 'b'}) {
      const v1::Session session = b.Watch("street", Id(robot, i));
      EXPECT_EQ(session.state(), v1::SESSION_STATE_COMMITTED) << session.id() << ": " << session.reason();
    }
  }
  ExpectWhole(b, 2 * static_cast<uint64_t>(sessions));
}

}  // namespace
}  // namespace mapkeep
