#include "client/simulator/street.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "client/simulator/street_session.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

const Street& FirstStreet() {
  static const Street* const street = new Street(*MakeStreet({}));
  return *street;
}

DriveParameters DriveWith(const char* sensor, size_t scans) { return {.sensor = *SensorNamed(sensor), .scans = scans}; }

/// Length of a ray through the fixed scene; 0 if it meets nothing.
double RangeOf(const Street& street, const Eigen::Vector3d& from, const Eigen::Vector3f& direction) {
  std::vector<MeshInstance> instances;
  for (const SceneObject& object : street.fixed) {
    Pose pose = object.track.front().pose;
    pose.pretranslate(-from);
    instances.push_back({object.mesh, pose, pose});
  }
  const std::vector<Ray> rays = {{.direction = direction.normalized()}};
  const auto hits = street.caster.Cast(instances, rays, 100);
  EXPECT_TRUE(hits.ok()) << hits.status();
  return hits.ok() ? hits->front().range : 0;
}

TEST(Street, AnHdl64ScanHasThePointsOfOneInARealStreet) {
  const auto session = DriveThrough(FirstStreet(), 0, DriveWith("hdl64", 100));
  ASSERT_TRUE(session.ok()) << session.status();
  std::map<ObjectKind, size_t> points;
  std::map<uint32_t, ObjectKind> kinds;
  for (const SceneObject& object : session->objects) kinds[object.id] = object.kind;
  for (const size_t scan : {0, 40, 80}) {
    const auto labelled = session->labelled(scan);
    ASSERT_TRUE(labelled.ok()) << labelled.status();
    EXPECT_GT(labelled->scan.points.size(), 100'000U);
    EXPECT_LT(labelled->scan.points.size(), 126'000U);
    EXPECT_TRUE(CheckScan(labelled->scan).ok());
    for (const uint32_t label : labelled->labels) ++points[kinds.at(ObjectOfLabel(label))];
  }
  for (const ObjectKind kind :
       {ObjectKind::kGround, ObjectKind::kBuilding, ObjectKind::kBridge, ObjectKind::kPole, ObjectKind::kTree,
        ObjectKind::kFence, ObjectKind::kHedge, ObjectKind::kCar, ObjectKind::kCyclist, ObjectKind::kPedestrian}) {
    EXPECT_GT(points[kind], 0U) << NameOf(kind);
  }
  // The far ground is grazed: it is seen to some 40 m, and seldom beyond 80.
  EXPECT_GT(points[ObjectKind::kGround], 100'000U);
}

TEST(Street, TheGroundIsARoadBetweenKerbsThatLeadsUnderABridge) {
  const Street& street = FirstStreet();
  const Ground& ground = street.ground;
  const double bridge = ground.plans()[1].bridge;
  const double road = ground.HeightAt(bridge, 0.1);
  const Eigen::Vector3d below = ground.PointAt(bridge, 0.1, 2), above = ground.PointAt(bridge, 0.1, 20);
  EXPECT_NEAR(below.z() - RangeOf(street, below, {0, 0, -1}), road, 0.02);
  EXPECT_NEAR(below.z() + RangeOf(street, below, {0, 0, 1}), road + kBridgeClearance, 0.1);
  EXPECT_NEAR(above.z() - RangeOf(street, above, {0, 0, -1}), road + kBridgeClearance + 0.6, 0.1);
  EXPECT_NEAR(ground.HeightAt(bridge, kKerb + 0.02) - ground.HeightAt(bridge, kKerb - 0.02), 0.12, 0.01);
}

TEST(Street, TreesLetSomeRaysThrough) {
  const Street& street = FirstStreet();
  size_t stopped = 0, passed = 0;
  for (const SceneObject& tree : street.fixed) {
    if (tree.kind != ObjectKind::kTree) continue;
    const MeshInstance alone{tree.mesh, Pose(Eigen::Translation3d(10, 0, 0)), Pose(Eigen::Translation3d(10, 0, 0))};
    std::vector<Ray> rays;
    for (double y = -1; y < 1; y += 0.05) {
      for (double z = 3.4; z < 4.6; z += 0.05) {
        rays.push_back({.direction = Eigen::Vector3d(10, y, z).cast<float>().normalized()});
      }
    }
    const auto hits = street.caster.Cast({&alone, 1}, rays, 100);
    ASSERT_TRUE(hits.ok()) << hits.status();
    for (const RayHit& hit : *hits) {
      ++(hit.instance == RayHit::kNothing ? passed : stopped);
    }
  }
  const double share = static_cast<double>(stopped) / static_cast<double>(stopped + passed);
  EXPECT_GT(share, 0.2);
  EXPECT_LT(share, 0.9);
}

TEST(Street, OtherSeedsAreOtherStreetsAndRepeatedOnesAreAlike) {
  const auto profile = [](const Street& street, double from) {
    std::vector<double> ranges;
    for (double s = 15; s < 100; s += 1) {
      const Eigen::Vector3d eye = street.ground.PointAt(from + s, 0, 3);
      const Pose upright = street.ground.UprightAt(from + s, 0, 0);
      ranges.push_back(RangeOf(street, eye, (upright.linear() * Eigen::Vector3d::UnitY()).cast<float>()));
    }
    return ranges;
  };
  const auto alike = [](const std::vector<double>& a, const std::vector<double>& b) {
    size_t count = 0;
    for (size_t i = 0; i < a.size(); ++i) count += std::abs(a[i] - b[i]) < 0.02 ? 1 : 0;
    return static_cast<double>(count) / static_cast<double>(a.size());
  };
  const Street other = *MakeStreet({.seed = 2, .streets = 2});
  const Street repeated = *MakeStreet({.seed = 2, .streets = 2, .repeated = true});
  EXPECT_LT(alike(profile(FirstStreet(), 0), profile(other, 0)), 0.3);
  EXPECT_LT(alike(profile(other, 0), profile(other, 100)), 0.3);
  EXPECT_GT(alike(profile(repeated, 0), profile(repeated, 100)), 0.97);
}

TEST(Street, SessionsOfAStreetDifferInTrafficAndShareTheRest) {
  const auto first = DriveThrough(FirstStreet(), 0, DriveWith("vlp16", 10));
  const auto second = DriveThrough(FirstStreet(), 1, DriveWith("vlp16", 10));
  const auto again = DriveThrough(FirstStreet(), 1, DriveWith("vlp16", 10));
  EXPECT_EQ(first->truth.front().matrix(), second->truth.front().matrix());
  EXPECT_DOUBLE_EQ(second->times[0] - first->times[0], 86400);
  EXPECT_NE(first->scans.read(3)->points, second->scans.read(3)->points);
  EXPECT_EQ(again->scans.read(3)->points, second->scans.read(3)->points);
}

TEST(Street, AWaitingCarStandsThenLeavesAndIsMovingAllTheTime) {
  DriveParameters drive = DriveWith("vlp16", 300);
  drive.traffic = {.density = 0, .crowd = 0, .wait = 20};
  const auto session = DriveThrough(FirstStreet(), 0, drive);
  const auto count = std::count_if(session->objects.begin(), session->objects.end(), [](const SceneObject& object) {
    if (object.state != ObjectState::kMoving) return false;
    const Pose start = *PoseAt(object.track, 0);
    EXPECT_EQ(object.kind, ObjectKind::kCar);
    EXPECT_TRUE(PoseAt(object.track, 19.9)->isApprox(start, 1e-9));
    EXPECT_GT((PoseAt(object.track, 25)->translation() - start.translation()).norm(), 10);
    return true;
  });
  EXPECT_EQ(count, 3) << "one a street";
}

TEST(Street, ACarThatPullsOutLetsTheRobotPassAndStaysBehindIt) {
  for (const bool stop_and_go : {false, true}) {
    for (const double wait : {1.0, 2.5, 4.0, 6.0}) {
      DriveParameters drive = DriveWith("vlp16", 300);
      drive.start = 10;
      drive.traffic = {.density = 0, .crowd = 0, .stop_and_go = stop_and_go, .wait = wait};
      const auto session = DriveThrough(FirstStreet(), 0, drive);
      int pulled_out = 0;
      for (const SceneObject& object : session->objects) {
        if (object.state != ObjectState::kMoving) continue;
        ++pulled_out;
        for (size_t i = 0; i < session->truth.size(); ++i) {
          const double time = static_cast<double>(i) * drive.sensor.period;
          const std::optional<Pose> pose = PoseAt(object.track, time);
          if (!pose.has_value()) continue;
          const Eigen::Vector2d apart = (session->truth[i].inverse() * pose->translation()).head<2>();
          // Beside it is only who is still parked, a lane's middle away.
          EXPECT_TRUE(std::abs(apart.x()) > 5 || std::abs(apart.y()) > 2)
              << "after " << time << " s: " << apart.transpose();
        }
      }
      EXPECT_GT(pulled_out, 0);
    }
  }
}

TEST(Street, StopAndGoStopsTheRobotToo) {
  DriveParameters drive = DriveWith("vlp16", 240);
  drive.traffic.stop_and_go = true;
  const auto session = DriveThrough(FirstStreet(), 0, drive);
  size_t standing = 0;
  for (size_t i = 1; i < session->truth.size(); ++i) {
    const double step = (session->truth[i].translation() - session->truth[i - 1].translation()).norm();
    EXPECT_LT(step, 0.56);
    standing += step < 0.02 ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(standing), 80, 15);
}

TEST(Street, TheReverseRouteComesTheOtherWayInTheOtherLane) {
  DriveParameters drive = DriveWith("vlp16", 2);
  drive.reverse = true;
  const Pose reverse = DriveThrough(FirstStreet(), 0, drive)->truth[0];
  drive.reverse = false;
  drive.start = 90;  // the end of the lane
  const Pose forward = DriveThrough(FirstStreet(), 0, drive)->truth[0];
  EXPECT_NEAR((reverse.translation() - forward.translation()).norm(), 2 * kLane, 0.1);
  EXPECT_NEAR(AngleBetween(reverse, forward), M_PI, 0.1);
}

TEST(Street, ALongRideTurnsRoundAndStaysOnItsRoad) {
  DriveParameters drive = DriveWith("vlp16", 1000);
  drive.traffic.density = 0.2;
  const auto session = DriveThrough(FirstStreet(), 0, drive);
  for (size_t i = 1; i < session->truth.size(); ++i) {
    const Pose step = session->truth[i - 1].inverse() * session->truth[i];
    EXPECT_LT(step.translation().norm(), 0.6);
    EXPECT_LT(AngleBetween(step, Pose::Identity()), 0.35);
    const double up = session->truth[i].linear().col(2).z();
    EXPECT_GT(up, std::cos(0.1)) << "z stays up within the slope of the street";
  }
}

TEST(Street, ParametersOutOfTheirRangeAreNamed) {
  EXPECT_THAT(std::string(MakeStreet({.streets = 0}).status().message()), HasSubstr("streets is 0"));
  EXPECT_THAT(std::string(MakeStreet({.change_rate = 1.5}).status().message()), HasSubstr("change_rate is 1.5"));
  DriveParameters drive = DriveWith("vlp16", 1);
  drive.odometry.drift = -1;
  EXPECT_THAT(std::string(DriveThrough(FirstStreet(), 0, drive).status().message()), HasSubstr("drift is -1"));
}

}  // namespace
}  // namespace mapkeep
