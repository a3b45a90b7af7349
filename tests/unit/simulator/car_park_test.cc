#include "client/simulator/car_park.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

const CarPark& House() {
  static const CarPark* const house = new CarPark(*MakeCarPark({.seed = 3, .change_rate = 0.4}));
  return *house;
}

DriveParameters DriveFor(size_t scans) { return {.sensor = *SensorNamed("vlp16"), .scans = scans}; }

TEST(CarPark, TheRobotDrivesTwoFloorsOverOneAnotherAndComesBack) {
  const auto session = DriveThroughCarPark(House(), 0, DriveFor(800));
  ASSERT_TRUE(session.ok()) << session.status();
  const double height = SensorNamed("vlp16")->height;
  size_t lower = 0, upper = 0;
  for (size_t i = 0; i < session->truth.size(); ++i) {
    const double floor = session->truth[i].translation().z() - height;
    lower += std::abs(floor) < 0.02 ? 1 : 0;
    upper += std::abs(floor - 3) < 0.02 ? 1 : 0;
    if (i == 0) continue;
    const Pose step = session->truth[i - 1].inverse() * session->truth[i];
    EXPECT_LT(step.translation().norm(), 0.6);
    EXPECT_LT(AngleBetween(step, Pose::Identity()), 0.3);
  }
  EXPECT_GT(lower, 100U);
  EXPECT_GT(upper, 100U);
}

TEST(CarPark, TheFloorIsUnderTheWheelsEverywhere) {
  // One ray straight down from the robot, on both floors and on the ramp.
  const auto session = DriveThroughCarPark(House(), 0, DriveFor(600));
  for (size_t i = 0; i < session->truth.size(); i += 5) {
    const Eigen::Vector3d from = session->truth[i].translation();
    std::vector<MeshInstance> instances;
    for (const SceneObject& object : House().fixed) {
      Pose pose = object.track.front().pose;
      pose.pretranslate(-from);
      instances.push_back({object.mesh, pose, pose});
    }
    const std::vector<Ray> down = {{.direction = -Eigen::Vector3f::UnitZ()}};
    const auto hits = House().caster.Cast(instances, down, 20);
    ASSERT_TRUE(hits.ok()) << hits.status();
    EXPECT_NEAR(hits->front().range, SensorNamed("vlp16")->height, 0.12) << "scan " << i;
  }
}

TEST(CarPark, CarsComeAndGoAndTheirIdsStay) {
  std::map<uint32_t, Eigen::Vector3d> before;
  std::set<ObjectState> seen;
  for (int session = 0; session < 4; ++session) {
    std::map<uint32_t, Eigen::Vector3d> there;
    const auto simulated = DriveThroughCarPark(House(), session, DriveFor(1));
    ASSERT_TRUE(simulated.ok()) << simulated.status();
    for (const SceneObject& object : simulated->objects) {
      if (object.kind != ObjectKind::kCar || object.state == ObjectState::kMoving) continue;
      const Eigen::Vector3d place = object.track.front().pose.translation();
      seen.insert(object.state);
      const bool was_there = before.contains(object.id) && before[object.id] == place;
      if (session > 0) {
        EXPECT_EQ(was_there, object.state != ObjectState::kArrived) << NameOf(object.state);
      }
      if (IsThere(object.state)) there[object.id] = place;
    }
    before = there;
  }
  EXPECT_EQ(seen, (std::set{ObjectState::kParked, ObjectState::kArrived, ObjectState::kLeft}));
}

TEST(CarPark, WhatItCannotDoIsRefused) {
  DriveParameters drive = DriveFor(1);
  drive.reverse = true;
  EXPECT_THAT(std::string(DriveThroughCarPark(House(), 0, drive).status().message()), HasSubstr("not for car parks"));
  EXPECT_THAT(std::string(MakeCarPark({.occupancy = -1}).status().message()), HasSubstr("occupancy is -1"));
}

}  // namespace
}  // namespace mapkeep
