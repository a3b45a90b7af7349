#include "client/simulator/session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <cstring>

#include "client/simulator/road_users.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

Pose At(double x, double y, double z) { return Pose(Eigen::Translation3d(x, y, z)); }

/// Mesh 0: the ground, 200 m square, its surface at z = 0. Mesh 1: a wall, 20 m along y, its face at x = 0. Mesh 2: a
/// car.
RayCaster SceneCaster() {
  TriangleMesh ground, wall;
  AddQuad(ground, {-100, -100, 0}, {100, -100, 0}, {100, 100, 0}, {-100, 100, 0}, Material::kPaving);
  AddBox(wall, {0, -10, 0}, {0.5F, 10, 6}, Material::kPlaster);
  auto caster = RayCaster::Create({ground, wall, MakeCar(4)});
  EXPECT_TRUE(caster.ok()) << caster.status();
  return *std::move(caster);
}

SceneObject Standing(uint32_t id, uint32_t mesh, const Pose& pose) {
  return {.id = id, .kind = ObjectKind::kFurniture, .mesh = mesh, .track = {{0, pose}}};
}

/// Drives along y past the sensor, 10 m in front of it, at 5 m/s.
SceneObject PassingCar(double first_time = 0) {
  const Eigen::AngleAxisd along(M_PI / 2, Eigen::Vector3d::UnitZ());
  return {.id = 7,
          .kind = ObjectKind::kCar,
          .state = ObjectState::kMoving,
          .mesh = 2,
          .track = {{first_time, At(10, -5, 0) * along}, {first_time + 2, At(10, 5, 0) * along}}};
}

Ride StandingRide(const char* sensor, size_t scans) {
  Ride ride{.sensor = *SensorNamed(sensor), .scans = scans, .start_time = 1e9};
  ride.sensor_pose = [height = ride.sensor.height](double) { return At(0, 0, height); };
  return ride;
}

TEST(Session, SingleRaysMeasureKnownShapes) {
  Ride ride = StandingRide("hdl64", 1);
  ride.sensor.elevations = {0, -0.1};
  ride.sensor.range_noise = 0;
  ride.sensor.drop_out = 0;
  const auto session = Simulate(SceneCaster(), {Standing(1, 0, At(0, 0, 0)), Standing(2, 1, At(12, 0, 0))}, ride);
  ASSERT_TRUE(session.ok()) << session.status();
  const auto labelled = session->labelled(0);
  ASSERT_TRUE(labelled.ok()) << labelled.status();
  size_t on_wall = 0, on_ground = 0;
  for (size_t i = 0; i < labelled->labels.size(); ++i) {
    const Eigen::Vector3f p = labelled->scan.points[i];
    EXPECT_EQ(ClassOfLabel(labelled->labels[i]), kStaticLabel);
    if (ObjectOfLabel(labelled->labels[i]) == 2) {
      // A slanted surface stretches the beam's spot: centimetres at most on this wall.
      EXPECT_NEAR(p.x(), 12, 0.03);
      EXPECT_LE(std::abs(p.y()), 10.05);
      ++on_wall;
    } else {
      EXPECT_EQ(ObjectOfLabel(labelled->labels[i]), 1U);
      EXPECT_NEAR(p.head<2>().norm(), ride.sensor.height / std::tan(0.1), 1.0);
      ++on_ground;
    }
  }
  // Seen from 12 m, 20 m of wall fill 79.6 degrees, in both rings; the lower ring meets the ground elsewhere, at 17 m.
  EXPECT_NEAR(static_cast<double>(on_wall), 2 * 2083 * 79.6 / 360, 4);
  EXPECT_NEAR(static_cast<double>(on_ground), 2083 * (360 - 79.6) / 360, 50);
}

TEST(Session, LabelsOfAMovingCarFollowIt) {
  const auto session = Simulate(SceneCaster(), {Standing(1, 0, At(0, 0, 0)), PassingCar()}, StandingRide("os1-64", 20));
  ASSERT_TRUE(session.ok()) << session.status();
  const auto& [low, high] = session->mesh_bounds[2];
  for (size_t i = 0; i < session->scans.count; ++i) {
    const auto labelled = session->labelled(i);
    ASSERT_TRUE(labelled.ok()) << labelled.status();
    const auto car = PoseAt(session->objects[1].track, 0.1 * static_cast<double>(i));
    ASSERT_TRUE(car.has_value());
    const Pose to_car = car->inverse() * session->truth[i];
    size_t moving = 0;
    for (size_t k = 0; k < labelled->labels.size(); ++k) {
      const Eigen::Vector3f p = (to_car * labelled->scan.points[k].cast<double>()).cast<float>();
      const bool inside = (p.array() > low.array() - 0.3F).all() && (p.array() < high.array() + 0.3F).all();
      const bool is_moving = ClassOfLabel(labelled->labels[k]) == kMovingLabel;
      // A mixed pixel at the car's outline may lie up to half a gap behind it.
      if (is_moving && !inside) {
        EXPECT_LT((p.cwiseMax(low).cwiseMin(high) - p).norm(), 1.3);
      }
      if (!is_moving && inside) {
        EXPECT_LT(p.z(), 0.35) << "only the ground is so near a car";
      }
      if (is_moving) {
        EXPECT_EQ(ObjectOfLabel(labelled->labels[k]), 7U);
      }
      moving += is_moving ? 1 : 0;
    }
    EXPECT_GT(moving, 300U) << "scan " << i;
  }
}

TEST(Session, WhatMovesAtAnyTimeIsMovingInEveryScanAndWhatMovesLaterIsNot) {
  const SceneObject ground = Standing(1, 0, At(0, 0, 0));
  SceneObject waiting = PassingCar();
  const Pose start = waiting.track[0].pose;
  waiting.track = {{0, start}, {1.5, start}, {2.5, At(0, 4, 0) * start}};
  const auto moving_points = [&](size_t scans) {
    const auto session = Simulate(SceneCaster(), {ground, waiting}, StandingRide("vlp16", scans));
    const auto first = session->labelled(0);
    size_t count = 0;
    for (const uint32_t label : first->labels) count += ClassOfLabel(label) == kMovingLabel ? 1 : 0;
    EXPECT_EQ(session->objects[1].state == ObjectState::kMoving, count > 0);
    return count;
  };
  EXPECT_GT(moving_points(30), 50U);
  EXPECT_EQ(moving_points(10), 0U);
}

TEST(Session, WhatOnlyShiftsItsWeightIsNeitherMovingNorStatic) {
  const SceneObject ground = Standing(1, 0, At(0, 0, 0));
  // Sways to both sides and ends where it began; `reach` metres from there at most.
  const auto label_of = [&](double reach) {
    SceneObject swaying = PassingCar();
    const Pose start = swaying.track[0].pose;
    swaying.track = {{0, start}, {0.5, At(0, reach, 0) * start}, {1.5, At(0, -reach, 0) * start}, {2, start}};
    const auto session = Simulate(SceneCaster(), {ground, swaying}, StandingRide("vlp16", 20));
    const auto scan = session->labelled(0);
    uint32_t seen = ~uint32_t{0};
    for (const uint32_t label : scan->labels) {
      if (ObjectOfLabel(label) == swaying.id) seen = ClassOfLabel(label);
    }
    return seen;
  };
  EXPECT_EQ(label_of(0), kStaticLabel);
  EXPECT_EQ(label_of(0.4), kUnsureLabel);
  EXPECT_EQ(label_of(0.6), kMovingLabel);
}

TEST(Session, TheSameArgumentsGiveTheSameBytesOnAnyNumberOfThreads) {
  const auto scan_on = [](int threads) {
    tbb::task_arena arena(threads);
    return arena.execute([] {
      const auto session =
          Simulate(SceneCaster(), {Standing(1, 0, At(0, 0, 0)), Standing(2, 1, At(20, 0, 0)), PassingCar()},
                   StandingRide("hdl64", 10));
      return *session->labelled(6);
    });
  };
  const LabelledScan one = scan_on(1), two = scan_on(2);
  ASSERT_EQ(one.scan.points.size(), two.scan.points.size());
  ASSERT_GT(one.scan.points.size(), 50000U);
  EXPECT_EQ(std::memcmp(one.scan.points.data(), two.scan.points.data(), 12 * one.scan.points.size()), 0);
  EXPECT_EQ(one.scan.intensities, two.scan.intensities);
  EXPECT_EQ(one.labels, two.labels);
}

TEST(Session, ARollingShutterMeasuresEachRayFromWhereTheSensorIsThen) {
  // Towards a wall at 20 m/s: 2 m in a sweep, which begins and ends at the back and meets the wall half way.
  Ride ride = StandingRide("hdl64", 1);
  ride.sensor.elevations = {0};
  ride.sensor.range_noise = 0;
  ride.sensor_pose = [](double time) { return At(20 * time, 0, 1.7); };
  const auto ahead = [&](bool rolling) {
    ride.rolling_shutter = rolling;
    const auto session = Simulate(SceneCaster(), {Standing(2, 1, At(30, 0, 0))}, ride);
    const auto scan = session->scans.read(0);
    for (const Eigen::Vector3f& p : scan->points) {
      if (std::abs(p.y()) < 0.1) return p.x();
    }
    return 0.0F;
  };
  EXPECT_NEAR(ahead(false), 30, 0.02);
  EXPECT_NEAR(ahead(true), 29, 0.05);
}

TEST(Session, TheSensorsOwnPlaceStaysFree) {
  SceneObject through = PassingCar();
  const auto near = [&](double x) {
    for (TrackKey& key : through.track) key.pose.translation().x() = x;
    const auto session = Simulate(SceneCaster(), {through}, StandingRide("os1-64", 20));
    return session->labelled(10)->labels.size();
  };
  EXPECT_EQ(near(0), 0U);
  EXPECT_GT(near(4), 1000U);
}

TEST(Session, BadScenesAreRefusedByName) {
  const auto message = [](std::vector<SceneObject> objects, const Ride& ride) {
    return std::string(Simulate(SceneCaster(), std::move(objects), ride).status().message());
  };
  EXPECT_THAT(message({Standing(3, 9, At(0, 0, 0))}, StandingRide("vlp16", 1)),
              HasSubstr("object 3 asks for mesh 9 of 3"));
  EXPECT_THAT(message({{.id = 4}}, StandingRide("vlp16", 1)), HasSubstr("object 4 is nowhere"));
  EXPECT_THAT(message({{.id = 5, .track = {{1, At(0, 0, 0)}, {1, At(1, 0, 0)}}}}, StandingRide("vlp16", 1)),
              HasSubstr("object 5 goes back in time"));
  EXPECT_THAT(message({}, StandingRide("vlp16", 0)), HasSubstr("no scans"));
  EXPECT_THAT(message({}, {.sensor = *SensorNamed("vlp16")}), HasSubstr("without a trajectory"));
  TriangleMesh broken;
  broken.triangles = {{0, 1, 2}};
  broken.materials = {Material::kWood};
  EXPECT_THAT(std::string(RayCaster::Create({broken}).status().message()), HasSubstr("mesh 0 has a triangle beyond"));
}

}  // namespace
}  // namespace mapkeep
