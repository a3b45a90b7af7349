#include "client/simulator/city.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

const City& Town() {
  static const City* const town = new City(*MakeCity({.seed = 5, .change_rate = 0.4}));
  return *town;
}

DriveParameters DriveFor(size_t scans) { return {.sensor = *SensorNamed("vlp16"), .scans = scans}; }

/// Of one ray straight down through what never changes; nothing below gives 0.
float DepthBelow(const Eigen::Vector3d& from) {
  std::vector<MeshInstance> instances;
  for (const City::Row& row : Town().rows) {
    for (const SceneObject& object : row.street.fixed) {
      Pose pose = row.place * object.track.front().pose;
      pose.pretranslate(-from);
      instances.push_back({object.mesh, pose, pose});
    }
  }
  const std::vector<Ray> down = {{.direction = -Eigen::Vector3f::UnitZ()}};
  const auto hits = Town().caster.Cast(instances, down, 20);
  EXPECT_TRUE(hits.ok()) << hits.status();
  return hits.ok() ? hits->front().range : 0;
}

TEST(City, TheRobotDrivesRoundTheBlockAndComesBackToWhereItBegan) {
  DriveParameters drive = DriveFor(2 + static_cast<size_t>(LengthOfRound() / 0.5));
  drive.traffic = {.density = 0, .crowd = 0};
  for (const bool reverse : {false, true}) {
    drive.reverse = reverse;
    const auto session = DriveThroughCity(Town(), 0, drive);
    ASSERT_TRUE(session.ok()) << session.status();
    const std::vector<Pose>& truth = session->truth;
    double area = 0;  // twice; its sign tells the way round
    for (size_t i = 1; i < truth.size(); ++i) {
      const Pose step = truth[i - 1].inverse() * truth[i];
      EXPECT_LT(step.translation().norm(), 0.7);
      EXPECT_LT(AngleBetween(step, Pose::Identity()), 0.15) << "scan " << i;
      const Eigen::Vector3d a = truth[i - 1].translation(), b = truth[i].translation();
      area += a.x() * b.y() - b.x() * a.y();
    }
    EXPECT_LT((truth.front().translation() - truth.back().translation()).norm(), 2);
    EXPECT_NEAR(std::abs(area) / 2, 100 * 100, 900);
    EXPECT_EQ(area < 0, reverse);
  }
}

TEST(City, TheRoadIsUnderTheWheelsAllTheWayRound) {
  DriveParameters drive = DriveFor(static_cast<size_t>(LengthOfRound() / 0.5));
  drive.traffic = {.density = 0, .crowd = 0};
  const auto session = DriveThroughCity(Town(), 0, drive);
  ASSERT_TRUE(session.ok()) << session.status();
  for (size_t i = 0; i < session->truth.size(); i += 7) {
    EXPECT_NEAR(DepthBelow(session->truth[i].translation()), drive.sensor.height, 0.12) << "scan " << i;
  }
}

TEST(City, EveryThingHasAnIdOfItsOwnThatLabelsHaveRoomFor) {
  const auto session = DriveThroughCity(Town(), 4, DriveFor(100));
  ASSERT_TRUE(session.ok()) << session.status();
  std::set<uint32_t> ids;
  for (const SceneObject& object : session->objects) {
    EXPECT_TRUE(ids.insert(object.id).second) << object.id;
    EXPECT_LE(object.id, 0xffffU);
  }
}

TEST(City, CarsOfAllFourStreetsComeAndGoFromDayToDay) {
  const auto session = DriveThroughCity(Town(), 1, DriveFor(20));
  ASSERT_TRUE(session.ok()) << session.status();
  std::set<uint32_t> streets;
  for (const SceneObject& object : session->objects) {
    if (object.state == ObjectState::kArrived) streets.insert(object.id / 16000);
  }
  EXPECT_EQ(streets.size(), 4U);
}

TEST(City, SaysWhatItCannotDo) {
  DriveParameters drive = DriveFor(10);
  drive.traffic.stop_and_go = true;
  const auto refused = DriveThroughCity(Town(), 0, drive);
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("stop_and_go"));
  EXPECT_EQ(MakeCity({.occupancy = 2}).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace mapkeep
