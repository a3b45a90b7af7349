#include "core/registration/plan_search.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <numbers>
#include <random>

#include "tests/unit/registration/scene.h"

namespace mapkeep {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

std::shared_ptr<const WallPlan> PlanOfTarget(const RegistrationTarget& target) {
  const auto part = std::make_shared<const PlanPart>(PlanOf(target.points, target.normals));
  return std::make_shared<const WallPlan>(std::span(&part, 1));
}

// What a drive sees, in the frame of its first scan, facing the sensors.
FacingPoints SubmapOf(const Scene& scene, const std::vector<Pose>& poses) {
  FacingPoints submap;
  const std::vector<Scan> scans = ScansOf(scene, poses);
  for (size_t i = 0; i < scans.size(); ++i) {
    const Pose relative = poses.front().inverse() * poses[i];
    for (const Eigen::Vector3f& point : scans[i].points) {
      submap.points.push_back(relative * point.cast<double>());
      submap.facing.emplace_back((relative.translation() - submap.points.back()).normalized());
    }
  }
  return submap;
}

void ExpectPlace(const Pose& found, const Pose& truth) {
  EXPECT_LT((found.translation() - truth.translation()).norm(), 0.6);
  EXPECT_LT(AngleBetween(found, truth), 2 * kDegree);
}

TEST(SearchPlan, FindsADriveAtAnyHeadingAndSaysHowSureItIs) {
  const Scene street = VariedStreetOf(-60, 90);
  const auto plan = PlanOfTarget(FacingStreet(TargetOf(street)));
  const auto drive = DriveAlong(10, 25, 1);
  for (const double yaw : {0.0, 75.0, 181.0}) {
    // The same drive by a sensor that is mounted at another angle.
    std::vector<Pose> turned;
    for (const Pose& pose : drive) turned.push_back(pose * MotionOf(yaw, {0, 0, 0}));
    const PlanQuery query = PlanQueryOf(SubmapOf(street, turned), {});
    const auto places = SearchPlan(query, *plan, {}, {});
    ASSERT_FALSE(places.empty()) << yaw;
    ExpectPlace(places[0].pose, turned.front());
    EXPECT_GT(places[0].walls, 0.5) << yaw;
    EXPECT_GT(places[0].floors, 0.8) << yaw;
    for (size_t i = 1; i < places.size(); ++i) EXPECT_LE(places[i].walls, places[i - 1].walls);
    EXPECT_GT(WallsMet(query, *plan, places[0].pose), 0.6) << yaw;
  }
}

TEST(SearchPlan, LooksOnlyInsideTheBox) {
  const Scene street = VariedStreetOf(-60, 90);
  const auto plan = PlanOfTarget(FacingStreet(TargetOf(street)));
  const PlanQuery query = PlanQueryOf(SubmapOf(street, DriveAlong(10, 25, 1)), {});
  const Eigen::AlignedBox3d box(Eigen::Vector3d(-50, -20, -10), Eigen::Vector3d(-20, 20, 10));
  for (const PlanPlace& place : SearchPlan(query, *plan, box, {})) {
    const Eigen::Vector3d middle = place.pose * (query.level.transpose() * query.middle);
    EXPECT_LT(middle.x(), -20 + 3);
    EXPECT_GT(middle.x(), -50 - 3);
  }
}

TEST(SearchPlan, ASensorThatLeansIsTurnedUprightFirst) {
  const Scene street = VariedStreetOf(-60, 90);
  const Pose lean = Pose(Eigen::AngleAxisd(8 * kDegree, Eigen::Vector3d::UnitY()));
  std::vector<Pose> drive;
  for (const Pose& pose : DriveAlong(0, 15, 1)) drive.push_back(pose * lean);
  const PlanQuery query = PlanQueryOf(SubmapOf(street, drive), {});
  EXPECT_LT(AngleBetween(Pose(Eigen::Quaterniond(query.level)), lean), 1.0 * kDegree);
  const auto places = SearchPlan(query, *PlanOfTarget(FacingStreet(TargetOf(street))), {}, {});
  ASSERT_FALSE(places.empty());
  ExpectPlace(places[0].pose, drive.front());
}

TEST(SearchPlan, TheHeightComesFromTheFloors) {
  const Scene street = VariedStreetOf(-60, 90);
  RegistrationTarget target = FacingStreet(TargetOf(street));
  for (Eigen::Vector3d& point : target.points) point.z() += 40;
  const auto drive = DriveAlong(10, 25, 1);
  const auto places = SearchPlan(PlanQueryOf(SubmapOf(street, drive), {}), *PlanOfTarget(target), {}, {});
  ASSERT_FALSE(places.empty());
  EXPECT_NEAR(places[0].pose.translation().z(), drive.front().translation().z() + 40, 0.2);
}

TEST(SearchPlan, NothingToLookForOrInGivesNoPlace) {
  const Scene street = VariedStreetOf(-30, 30);
  const auto plan = PlanOfTarget(FacingStreet(TargetOf(street)));
  EXPECT_TRUE(SearchPlan(PlanQueryOf({}, {}), *plan, {}, {}).empty());
  const Scene plane{CorridorOf(-30, 30)[0]};
  EXPECT_TRUE(SearchPlan(PlanQueryOf(SubmapOf(plane, DriveAlong(0, 9, 1)), {}), *plan, {}, {}).empty()) << "no walls";
  const PlanQuery query = PlanQueryOf(SubmapOf(street, DriveAlong(0, 9, 1)), {});
  EXPECT_TRUE(SearchPlan(query, WallPlan({}), {}, {}).empty());
}

TEST(SearchPlan, TheSameOnAnyNumberOfThreads) {
  const Scene street = VariedStreetOf(-60, 90);
  const auto plan = PlanOfTarget(FacingStreet(TargetOf(street)));
  const FacingPoints submap = SubmapOf(street, DriveAlong(10, 25, 1));
  std::vector<std::vector<PlanPlace>> all;
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    all.push_back(arena.execute([&] { return SearchPlan(PlanQueryOf(submap, {}), *plan, {}, {}); }));
  }
  for (const auto& places : all) {
    ASSERT_EQ(places.size(), all[0].size());
    for (size_t i = 0; i < places.size(); ++i) EXPECT_EQ(RowsOf(places[i].pose), RowsOf(all[0][i].pose));
  }
}

}  // namespace
}  // namespace mapkeep
