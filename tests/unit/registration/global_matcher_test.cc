#include "core/registration/global_matcher.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <limits>
#include <numbers>
#include <random>

namespace mapkeep {
namespace {

constexpr double kSpacing = 0.22;  // metres between the points of a surface

// Points of a rectangle from `corner` along two edges, facing `facing`, with 1 cm of noise along it.
void AddRectangle(const Eigen::Vector3d& corner, const Eigen::Vector3d& along, const Eigen::Vector3d& across,
                  const Eigen::Vector3d& facing, std::mt19937& random, FacingPoints& scene) {
  std::normal_distribution<double> noise(0, 0.01);
  const int rows = static_cast<int>(along.norm() / kSpacing);
  const int columns = static_cast<int>(across.norm() / kSpacing);
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      const Eigen::Vector3d point = corner + along * row / std::max(rows, 1) + across * column / std::max(columns, 1);
      scene.points.emplace_back(point + noise(random) * facing);
      scene.facing.push_back(facing);
    }
  }
}

void AddBox(const Eigen::Vector3d& corner, const Eigen::Vector3d& x, const Eigen::Vector3d& y, double height,
            std::mt19937& random, FacingPoints& scene) {
  const Eigen::Vector3d z(0, 0, height);
  AddRectangle(corner, x, z, -y.normalized(), random, scene);
  AddRectangle(corner + y, x, z, y.normalized(), random, scene);
  AddRectangle(corner, y, z, -x.normalized(), random, scene);
  AddRectangle(corner + x, y, z, x.normalized(), random, scene);
  AddRectangle(corner + z, x, y, Eigen::Vector3d::UnitZ(), random, scene);
}

// A yard of 60 m with sheds of any size and turn: `place` says which yard, `visit` how the noise fell.
FacingPoints Yard(int place, int visit) {
  std::mt19937 plan(place);
  std::mt19937 noise(1000 + visit);
  std::uniform_real_distribution<double> any(0, 1);
  FacingPoints scene;
  AddRectangle({0, 0, 0}, {60, 0, 0}, {0, 60, 0}, Eigen::Vector3d::UnitZ(), noise, scene);
  for (int i = 0; i < 25; ++i) {
    const double turn = std::numbers::pi * any(plan);
    const Eigen::Vector3d x = (1 + 4 * any(plan)) * Eigen::Vector3d(std::cos(turn), std::sin(turn), 0);
    const Eigen::Vector3d y = (1 + 4 * any(plan)) * Eigen::Vector3d(-std::sin(turn), std::cos(turn), 0);
    const double height = 1 + 3 * any(plan);
    const Eigen::Vector3d corner(5 + 50 * any(plan), 5 + 50 * any(plan), 0);
    AddBox(corner, x, y, height, noise, scene);
  }
  return scene;
}

FacingPoints Moved(FacingPoints scene, const Pose& motion) {
  for (auto& point : scene.points) point = motion * point;
  for (auto& facing : scene.facing) facing = motion.linear() * facing;
  return scene;
}

Pose MotionOf(double yaw, const Eigen::Vector3d& offset) {
  Pose motion = Pose::Identity();
  motion.linear() = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  motion.translation() = offset;
  return motion;
}

std::vector<std::shared_ptr<const MatchTarget>> TargetsOf(const FacingPoints& map) {
  std::vector<std::shared_ptr<const MatchTarget>> targets;
  for (const double voxel : {0.5, 1.0}) targets.push_back(std::make_shared<MatchTarget>(FeaturesOf(map, voxel, {})));
  return targets;
}

GlobalMatch Match(const FacingPoints& source, const FacingPoints& map) {
  return MatchGlobally(source, TargetsOf(map), {});
}

TEST(GlobalMatcher, FindsAYardAgainFromAnyFrame) {
  const auto targets = TargetsOf(Yard(1, 1));
  for (const double yaw : {0.3, 2.4, -1.9}) {
    const Pose motion = MotionOf(yaw, {150, -80, 2});
    const GlobalMatch match = MatchGlobally(Moved(Yard(1, 2), motion), targets, {});
    ASSERT_FALSE(match.candidates.empty()) << match.reason;
    const Pose error = match.candidates[0].pose * motion;
    EXPECT_LT((error * Eigen::Vector3d(30, 30, 0) - Eigen::Vector3d(30, 30, 0)).norm(), 0.3);
    EXPECT_LT(AngleBetween(error, Pose::Identity()), 0.02);
    EXPECT_GE(match.candidates[0].inliers, MatcherParameters().enough_inliers);
    EXPECT_TRUE(match.reason.empty());
  }
}

TEST(GlobalMatcher, AnotherYardIsNotTakenForThisOne) {
  const GlobalMatch match = Match(Yard(2, 1), Yard(1, 1));
  for (const PoseCandidate& candidate : match.candidates) {
    EXPECT_LT(candidate.inliers, MatcherParameters().enough_inliers);
  }
}

TEST(GlobalMatcher, GivesTheSameBitsOnAnyNumberOfThreads) {
  const FacingPoints map = Yard(1, 1);
  const FacingPoints source = Moved(Yard(1, 2), MotionOf(1, {10, 20, 0}));
  const auto run = [&](size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return Match(source, map);
  };
  const GlobalMatch one = run(1);
  ASSERT_FALSE(one.candidates.empty());
  for (const size_t threads : {2, 4}) {
    const GlobalMatch more = run(threads);
    ASSERT_EQ(more.candidates.size(), one.candidates.size());
    for (size_t i = 0; i < one.candidates.size(); ++i) {
      EXPECT_EQ(more.candidates[i].inliers, one.candidates[i].inliers);
      EXPECT_EQ(more.candidates[i].pose.matrix(), one.candidates[i].pose.matrix());
    }
  }
}

// Two walls and a floor: every place along it looks the same.
FacingPoints Corridor(double length, int visit) {
  std::mt19937 noise(visit);
  FacingPoints scene;
  AddRectangle({0, 0, 0}, {length, 0, 0}, {0, 4, 0}, Eigen::Vector3d::UnitZ(), noise, scene);
  AddRectangle({0, 0, 0}, {length, 0, 0}, {0, 0, 3}, Eigen::Vector3d::UnitY(), noise, scene);
  AddRectangle({0, 4, 0}, {length, 0, 0}, {0, 0, 3}, -Eigen::Vector3d::UnitY(), noise, scene);
  return scene;
}

FacingPoints Plane(int visit) {
  std::mt19937 noise(visit);
  FacingPoints scene;
  AddRectangle({0, 0, 0}, {60, 0, 0}, {0, 60, 0}, Eigen::Vector3d::UnitZ(), noise, scene);
  return scene;
}

void ExpectRefused(const GlobalMatch& match) {
  EXPECT_TRUE(match.candidates.empty()) << match.candidates[0].inliers << " inliers";
  EXPECT_FALSE(match.reason.empty());
}

TEST(GlobalMatcher, RefusesAnEmptyCorridor) { ExpectRefused(Match(Corridor(60, 1), Corridor(200, 2))); }

TEST(GlobalMatcher, RefusesAPlane) { ExpectRefused(Match(Plane(1), Plane(2))); }

TEST(GlobalMatcher, RefusesWhatIsNotAPlace) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const FacingPoints yard = Yard(1, 1);
  const FacingPoints one{{{1, 2, 3}}, {{0, 0, 1}}};
  const FacingPoints same{std::vector<Eigen::Vector3d>(5000, {1, 2, 3}), std::vector<Eigen::Vector3d>(5000, {0, 0, 1})};
  const FacingPoints nothing{std::vector<Eigen::Vector3d>(5000, {kNan, kNan, kNan}),
                             std::vector<Eigen::Vector3d>(5000, {kNan, kNan, kNan})};
  for (const FacingPoints& odd : {FacingPoints{}, one, same, nothing}) {
    ExpectRefused(Match(odd, yard));
    ExpectRefused(Match(yard, odd));
    ExpectRefused(Match(odd, odd));
  }
  ExpectRefused(MatchGlobally(yard, {}, {}));
}

}  // namespace
}  // namespace mapkeep
