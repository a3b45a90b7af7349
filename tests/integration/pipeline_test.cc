#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>

#include "tests/integration/daemon_process.h"
#include "tests/integration/robot.h"
#include "tests/integration/status_matchers.h"

namespace mapkeep {
namespace {

using grpc::StatusCode;
using ::testing::ElementsAre;

constexpr int kScans = 16;
constexpr double kFirstDay = 1.7e9, kSecondDay = kFirstDay + 86400;
constexpr VoxelIndex kCarBlock{1, -1, 0};

// The street with a parked car, and the same street the day after it left.
struct Days {
  Drive first, second;
};

const Days& TwoDays() {
  static const auto* const days = [] {
    Scene with_car = Street();
    with_car.push_back(Car());
    return new Days{DriveAlong(with_car, kScans, kFirstDay), DriveAlong(Street(), kScans, kSecondDay)};
  }();
  return *days;
}

v1::Session Merge(Robot& robot, const std::string& id, const Drive& drive, bool keep_scans = false) {
  EXPECT_THAT(robot.UploadDrive("street", id, drive, keep_scans), IsOk());
  return robot.Watch("street", id);
}

// All voxels of the two days' map from a daemon that nothing disturbed.
std::string Undisturbed(const std::vector<std::string>& flags) {
  const DaemonProcess daemon(flags);
  Robot robot(daemon.listen());
  EXPECT_THAT(robot.CreateMap("street"), IsOk());
  Merge(robot, "day-1", TwoDays().first);
  const v1::Session second = Merge(robot, "day-2", TwoDays().second);
  EXPECT_EQ(second.state(), v1::SESSION_STATE_COMMITTED) << second.reason();
  return BytesOf(robot.Tiles("street", true));
}

TEST(Pipeline, ACarAloneInItsBlockLeavesAndDisappears) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  const v1::Session first = Merge(robot, "day-1", TwoDays().first);
  ASSERT_EQ(first.state(), v1::SESSION_STATE_COMMITTED) << first.reason();
  const auto parked = robot.Tiles("street", false);
  const v1::VoxelBlock* car = FindBlock(parked, kCarBlock);
  ASSERT_NE(car, nullptr);
  EXPECT_GT(car->positions_size(), 20);

  const v1::Session second = Merge(robot, "day-2", TwoDays().second);
  ASSERT_EQ(second.state(), v1::SESSION_STATE_COMMITTED) << second.reason();
  const auto left = robot.Tiles("street", false);
  EXPECT_EQ(FindBlock(left, kCarBlock), nullptr);
  EXPECT_GT(left.size(), parked.size() / 2) << "the street is still there";
}

TEST(Pipeline, TheReportSaysWhatHappened) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  Merge(robot, "day-1", TwoDays().first);
  const v1::Session session = Merge(robot, "day-2", TwoDays().second, true);
  const v1::SessionReport& report = session.report();
  std::vector<std::string> stages;
  for (const v1::StageTime& stage : report.stages()) stages.push_back(stage.stage());
  EXPECT_THAT(stages, ElementsAre("align", "clean", "merge", "commit"));
  EXPECT_EQ(report.base_epoch(), 1U);
  EXPECT_EQ(report.epoch(), 2U);
  EXPECT_GT(report.windows_size(), 0);
  uint64_t points = 0;
  for (const Scan& scan : TwoDays().second.scans) points += scan.points.size();
  EXPECT_EQ(report.points(), points);
  EXPECT_GT(report.session_voxels(), 0U);
  EXPECT_GE(report.voxels_kept(), report.static_voxels());
  EXPECT_GT(report.static_voxels(), 0U);
  EXPECT_GT(report.blocks_touched(), 0U);
  EXPECT_EQ(session.start_time(), kSecondDay);
  EXPECT_GE(session.ended(), session.created());
  EXPECT_TRUE(session.keep_scans());

  v1::Map map;
  ASSERT_THAT(robot.GetMap("street", map), IsOk());
  EXPECT_EQ(map.epoch(), 2U);
  EXPECT_EQ(map.sessions(), 2U);
  EXPECT_GT(map.static_voxels(), 0U);

  v1::ListScanPosesRequest request;
  v1::ListScanPosesResponse poses;
  request.set_map("street");
  request.set_id("day-2");
  request.set_first(3);
  request.set_page_size(2);
  ASSERT_THAT(robot.sessions().ListScanPoses(Robot::Call().get(), request, &poses), IsOk());
  EXPECT_EQ(poses.scan_count(), static_cast<uint32_t>(kScans));
  ASSERT_EQ(poses.poses_size(), 2);
  EXPECT_NEAR(poses.poses(0).rows(3), TwoDays().second.poses[3].translation().x(), 0.05);
}

TEST(Pipeline, ABoxShowsItsVoxelsAndTwoHalvesAreTheWhole) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  Merge(robot, "day-1", TwoDays().first);
  const auto voxels = [&](double min_x, double max_x) {
    v1::Box box;
    box.mutable_min()->set_x(min_x);
    box.mutable_max()->set_x(max_x);
    for (auto* corner : {box.mutable_min(), box.mutable_max()}) {
      const double sign = corner == box.mutable_min() ? -1 : 1;
      corner->set_y(100 * sign);
      corner->set_z(100 * sign);
    }
    size_t count = 0;
    for (const v1::VoxelBlock& block : robot.Tiles("street", true, &box)) count += block.positions_size();
    return count;
  };
  v1::Map map;
  ASSERT_THAT(robot.GetMap("street", map), IsOk());
  EXPECT_EQ(voxels(-100, 100), map.voxels());
  EXPECT_EQ(voxels(-100, 1.7) + voxels(1.7, 100), map.voxels());
  EXPECT_GT(voxels(-100, 1.7), 0U);
  EXPECT_EQ(voxels(500, 600), 0U);
}

TEST(Pipeline, CommitMayBeRepeatedAndScansGoUnlessKept) {
  DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  const v1::Session first = Merge(robot, "day-1", TwoDays().first);
  v1::Session again;
  EXPECT_THAT(robot.Commit("street", "day-1", &again), IsOk());
  EXPECT_EQ(again.SerializeAsString(), first.SerializeAsString());
  EXPECT_THAT(robot.Begin("street", "day-1", Wire(TwoDays().first), &again), IsOk());
  EXPECT_EQ(again.state(), v1::SESSION_STATE_COMMITTED);
  EXPECT_THAT(robot.Send("street", "day-1", Wire(TwoDays().first)),
              FailsWith(StatusCode::FAILED_PRECONDITION, {"day-1"}));
  v1::Map map;
  ASSERT_THAT(robot.GetMap("street", map), IsOk());
  EXPECT_EQ(map.epoch(), 1U);
  EXPECT_THAT(robot.DeleteSession("street", "day-1"), IsOk());
  EXPECT_THAT(robot.GetSession("street", "day-1", again), FailsWith(StatusCode::NOT_FOUND, {"day-1"}));
  EXPECT_THAT(robot.GetMap("street", map), IsOk());
  EXPECT_GT(map.voxels(), 0U);
}

TEST(Pipeline, AnotherPlaceIsRefusedAndTheMapStays) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  Merge(robot, "day-1", TwoDays().first);
  const std::string before = BytesOf(robot.Tiles("street", true));
  Scene elsewhere = {Street()[0]};
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector3d corner(-25 + 4.3 * i, (i % 3 - 1) * 6.1 + (i % 2 == 0 ? 4 : -9), -0.3);
    elsewhere.emplace_back(corner, corner + Eigen::Vector3d(2.1 + 0.3 * (i % 4), 1.7, 2.0 + 0.4 * i));
  }
  const v1::Session lost = Merge(robot, "lost", DriveAlong(elsewhere, kScans, kSecondDay, {300, 0, 0}));
  EXPECT_EQ(lost.state(), v1::SESSION_STATE_REFUSED);
  EXPECT_FALSE(lost.reason().empty());
  EXPECT_EQ(BytesOf(robot.Tiles("street", true)), before);
}

TEST(Pipeline, AnInitialPoseAtUploadPlacesTheSessionThatFoundsAMapAndThoseThatFollow) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  const auto upload = [&](const std::string& id, const Drive& drive, const Eigen::Vector3d& at) {
    const std::vector<WireScan> scans = Wire(drive);
    v1::BeginSessionRequest request;
    v1::BeginSessionResponse response;
    request.set_map("street");
    request.set_id(id);
    for (const WireScan& scan : scans) request.add_scan_crc32c(scan.header.crc32c());
    request.mutable_initial_pose()->mutable_position()->set_x(at.x());
    request.mutable_initial_pose()->mutable_position()->set_y(at.y());
    request.mutable_initial_pose()->mutable_position()->set_z(at.z());
    EXPECT_THAT(robot.sessions().BeginSession(Robot::Call().get(), request, &response), IsOk());
    EXPECT_THAT(robot.Send("street", id, scans), IsOk());
    EXPECT_THAT(robot.Commit("street", id), IsOk());
    return robot.Watch("street", id);
  };
  const auto first_pose = [&](const std::string& id) {
    v1::ListScanPosesRequest request;
    v1::ListScanPosesResponse response;
    request.set_map("street");
    request.set_id(id);
    EXPECT_THAT(robot.sessions().ListScanPoses(Robot::Call().get(), request, &response), IsOk());
    return response.poses_size() == 0
               ? Eigen::Vector3d(Eigen::Vector3d::Zero())
               : Eigen::Vector3d(response.poses(0).rows(3), response.poses(0).rows(7), response.poses(0).rows(11));
  };
  const Eigen::Vector3d start(120, -40, 3);
  const v1::Session founder = upload("day-1", TwoDays().first, start);
  ASSERT_EQ(founder.state(), v1::SESSION_STATE_COMMITTED) << founder.reason();
  EXPECT_LT((first_pose("day-1") - start).norm(), 0.1);
  // The next day's is only roughly known.
  const v1::Session second = upload("day-2", TwoDays().second, start + Eigen::Vector3d(0.6, -0.5, 0.2));
  ASSERT_EQ(second.state(), v1::SESSION_STATE_COMMITTED) << second.reason();
  EXPECT_LT((first_pose("day-2") - start).norm(), 0.1);
}

TEST(Pipeline, AFirstSessionFarFromZeroSetsTheOrigin) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  const Eigen::Vector3d offset(691'234, 5'335'678, 512);
  const v1::Session session = Merge(robot, "day-1", DriveAlong(Street(), kScans, kFirstDay, offset));
  ASSERT_EQ(session.state(), v1::SESSION_STATE_COMMITTED) << session.reason();
  v1::Map map;
  ASSERT_THAT(robot.GetMap("street", map), IsOk());
  EXPECT_EQ(map.origin().x(), 691'200);
  EXPECT_EQ(map.origin().y(), 5'335'700);
  EXPECT_EQ(map.origin().z(), 500);
  EXPECT_LT(map.bounds().max().x(), 200);
  const v1::Session second = Merge(robot, "day-2", DriveAlong(Street(), kScans, kSecondDay, offset));
  EXPECT_EQ(second.state(), v1::SESSION_STATE_COMMITTED) << second.reason();
}

TEST(Pipeline, OneAndTwoThreadsLeaveTheSameBytes) {
  const std::string one = Undisturbed({"--threads", "1"});
  EXPECT_FALSE(one.empty());
  EXPECT_EQ(Undisturbed({"--threads", "2"}), one);
}

TEST(Pipeline, KilledInAnyStageItGoesOnToTheSameMap) {
  const std::string undisturbed = Undisturbed({});
  int killed_at_work = 0;
  for (const char* stage : {"align", "clean", "merge", "commit"}) {
    SCOPED_TRACE(stage);
    DaemonProcess daemon;
    {
      Robot robot(daemon.listen());
      ASSERT_THAT(robot.CreateMap("street"), IsOk());
      Merge(robot, "day-1", TwoDays().first);
      ASSERT_THAT(robot.UploadDrive("street", "day-2", TwoDays().second), IsOk());
      const v1::Session met =
          robot.Watch("street", "day-2", [&](const v1::Session& session) { return session.stage() == stage; });
      daemon.Kill();
      if (met.stage() == stage) ++killed_at_work;
    }
    daemon.Start();
    Robot robot(daemon.listen());
    const v1::Session resumed = robot.Watch("street", "day-2");
    EXPECT_EQ(resumed.state(), v1::SESSION_STATE_COMMITTED) << resumed.reason();
    EXPECT_EQ(resumed.report().stages_size(), 4);
    EXPECT_EQ(BytesOf(robot.Tiles("street", true)), undisturbed);
  }
  EXPECT_GE(killed_at_work, 2);
}

TEST(Pipeline, SigtermHandsTheJobToTheNextStart) {
  const std::string undisturbed = Undisturbed({});
  DaemonProcess daemon;
  {
    Robot robot(daemon.listen());
    ASSERT_THAT(robot.CreateMap("street"), IsOk());
    Merge(robot, "day-1", TwoDays().first);
    ASSERT_THAT(robot.UploadDrive("street", "day-2", TwoDays().second), IsOk());
    EXPECT_EQ(daemon.End(SIGTERM), 0) << daemon.log();
  }
  daemon.Start();
  Robot robot(daemon.listen());
  EXPECT_EQ(robot.Watch("street", "day-2").state(), v1::SESSION_STATE_COMMITTED);
  EXPECT_EQ(BytesOf(robot.Tiles("street", true)), undisturbed);
}

TEST(Pipeline, DeletingAMapEndsItsSessions) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  ASSERT_THAT(robot.UploadDrive("street", "day-1", TwoDays().first), IsOk());
  ASSERT_THAT(robot.UploadDrive("street", "day-2", TwoDays().second), IsOk());
  ASSERT_THAT(robot.DeleteMap("street"), IsOk());
  v1::Session session;
  EXPECT_THAT(robot.GetSession("street", "day-1", session), FailsWith(StatusCode::NOT_FOUND, {"street"}));
  EXPECT_THAT(robot.DeleteMap("street"), FailsWith(StatusCode::NOT_FOUND, {"street"}));
  ASSERT_THAT(robot.CreateMap("street"), IsOk());
  v1::Map map;
  ASSERT_THAT(robot.GetMap("street", map), IsOk());
  EXPECT_EQ(map.epoch(), 0U);
  EXPECT_THAT(robot.GetSession("street", "day-2", session), FailsWith(StatusCode::NOT_FOUND, {"day-2"}));
}

}  // namespace
}  // namespace mapkeep
