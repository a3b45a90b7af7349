#include "tests/bench/lifelong_truth.h"

#include <gtest/gtest.h>

#include <optional>
#include <utility>
#include <vector>

namespace mapkeep {
namespace {

constexpr uint32_t kCar = 7;

Pose At(double x, double y) { return Pose(Eigen::Translation3d(x, y, 0)); }

SceneObject Car(ObjectState state, const Pose& pose, std::optional<Pose> previous = std::nullopt) {
  return {
      .id = kCar, .kind = ObjectKind::kCar, .state = state, .track = {{.pose = pose}}, .previous = std::move(previous)};
}

// Days before a wall, which a sensor at the origin looks at past whatever cars there are: 4 m long, 2 m wide.
class Days {
 public:
  // `seen`: whether the session has points of the cars that stay.
  std::vector<TrueChange> Add(const std::vector<SceneObject>& cars, bool seen = true) {
    SimulatedSession session;
    session.truth = {Pose::Identity()};
    session.objects = cars;
    session.mesh_bounds = {{Eigen::Vector3f(-2, -1, 0), Eigen::Vector3f(2, 1, 1.5)}};
    LabelledScan scan;
    const auto put = [&scan](double x, double y, double z, uint32_t id) {
      scan.scan.points.emplace_back(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
      scan.labels.push_back(id << 16 | kStaticLabel);
    };
    for (double x = -20; x < 20; x += 0.05) {
      for (double z = 0; z < 3; z += 0.05) put(x, 20, z, 1);
    }
    for (const SceneObject& car : cars) {
      if (!seen || car.state == ObjectState::kMoving || !IsThere(car.state)) continue;
      const Eigen::Vector3d side = car.track.front().pose * Eigen::Vector3d(-2, -1, 0);
      for (double x = 0; x < 4; x += 0.05) {
        for (double z = 0; z < 1.5; z += 0.05) put(side.x() + x, side.y(), z, car.id);
      }
    }
    return truth_.AddDay(session, {&scan, 1});
  }

 private:
  LifelongTruth truth_;
};

void ExpectOne(const std::vector<TrueChange>& changes, bool appeared, const Pose& where) {
  ASSERT_EQ(changes.size(), 1U);
  EXPECT_EQ(changes[0].appeared, appeared);
  EXPECT_TRUE(changes[0].required);
  EXPECT_LT((changes[0].box.center().head<2>() - where.translation().head<2>()).norm(), 0.01);
}

TEST(LifelongTruth, ACarThatLeftInTheNightIsAChangeOfToday) {
  Days days;
  EXPECT_TRUE(days.Add({Car(ObjectState::kParked, At(0, 10))}).empty());
  ExpectOne(days.Add({Car(ObjectState::kLeft, At(0, 10))}), false, At(0, 10));
}

TEST(LifelongTruth, ACarThatMovedInTheNightAndDrivesOffTodayIsGoneFromWhereItStood) {
  Days days;
  EXPECT_TRUE(days.Add({Car(ObjectState::kParked, At(0, 10))}).empty());
  ExpectOne(days.Add({Car(ObjectState::kMoving, At(-30, 10), At(0, 10))}), false, At(0, 10));
}

TEST(LifelongTruth, TrafficThatWaitsThroughASessionCameAndIsGoneInTheNext) {
  Days days;
  EXPECT_TRUE(days.Add({}).empty());
  ExpectOne(days.Add({Car(ObjectState::kParked, At(0, 10))}), true, At(0, 10));
  ExpectOne(days.Add({}), false, At(0, 10));
  EXPECT_TRUE(days.Add({}).empty());
}

TEST(LifelongTruth, ACarThatWasHiddenOnItsFirstDayDoesNotAppearLater) {
  Days days;
  EXPECT_TRUE(days.Add({Car(ObjectState::kParked, At(0, 10))}, false).empty());
  EXPECT_TRUE(days.Add({Car(ObjectState::kParked, At(0, 10))}).empty());
}

}  // namespace
}  // namespace mapkeep
