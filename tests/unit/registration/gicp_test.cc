#include "core/registration/gicp.h"

#include <gtest/gtest.h>

#include "core/registration/fitness.h"
#include "core/registration/surface_normals.h"
#include "tests/unit/registration/scene.h"

namespace mapkeep {
namespace {

SurfaceCloud CloudOf(std::vector<Eigen::Vector3d> points) {
  const PointTree tree(points);
  SurfaceCloud cloud;
  for (const SurfaceNormal& surface : SurfaceNormalsAt(points, points, tree)) cloud.normals.push_back(surface.normal);
  cloud.points = std::move(points);
  return cloud;
}

TEST(SurfaceNormals, StandOnAPlaneAndAreAbsentOnALine) {
  std::mt19937 random(1);
  const auto plane = SampleOf({{{0, 0, 2}, {10, 0, 0}, {0, 10, 0}}}, 20, random);
  for (const SurfaceNormal& surface : SurfaceNormalsAt(plane, plane, PointTree(plane))) {
    EXPECT_GT(std::abs(surface.normal.z()), 0.97);
    EXPECT_LT(surface.roughness, 0.05);
  }
  std::vector<Eigen::Vector3d> line;
  for (int i = 0; i < 50; ++i) line.emplace_back(0.1 * i, 0, 0);
  for (const SurfaceNormal& surface : SurfaceNormalsAt(line, line, PointTree(line))) {
    EXPECT_TRUE(surface.normal.isZero());
  }
}

TEST(Gicp, FindsTheMotionBetweenTwoSamplesOfARoom) {
  const Scene room = StreetOf(-10, 20);
  std::mt19937 random(2);
  const SurfaceCloud source = CloudOf(SampleOf(room, 6, random)), target = CloudOf(SampleOf(room, 20, random));
  const Pose motion = MotionOf(2, {0.3, -0.2, 0.1});
  const auto result = RefineByGicp(source, target, PointTree(target.points), motion, {});
  EXPECT_TRUE(result.converged);
  EXPECT_GT(result.pairs, source.points.size() * 9 / 10);
  ExpectNear({result.pose}, {Pose::Identity()}, 0.01, 0.05);
}

TEST(Gicp, WhatTheGeometryDoesNotFixStaysAsGuessed) {
  // A floor fixes height, roll and pitch. Sideways the pairs of two random samples pull nowhere in particular.
  std::mt19937 random(3);
  const Scene floor{{{-15, -15, 0}, {30, 0, 0}, {0, 30, 0}}};
  const SurfaceCloud source = CloudOf(SampleOf(floor, 5, random)), target = CloudOf(SampleOf(floor, 25, random));
  const Pose guess = MotionOf(0, {0.5, 0.5, 0.3});
  const auto result = RefineByGicp(source, target, PointTree(target.points), guess, {});
  EXPECT_NEAR(result.pose.translation().z(), 0, 0.01);
  EXPECT_LT((result.pose.translation() - guess.translation()).head<2>().norm(), 0.25);
}

TEST(Gicp, WithoutAPairTheGuessComesBack) {
  const SurfaceCloud source{{{0, 0, 0}}, {{0, 0, 1}}}, target{{{50, 0, 0}}, {{0, 0, 1}}};
  const Pose guess = MotionOf(1, {1, 2, 3});
  for (const SurfaceCloud& empty_or_far : {target, SurfaceCloud{}}) {
    const auto result = RefineByGicp(source, empty_or_far, PointTree(empty_or_far.points), guess, {});
    EXPECT_EQ(RowsOf(result.pose), RowsOf(guess));
    EXPECT_EQ(result.pairs, 0U);
    EXPECT_FALSE(result.converged);
  }
  EXPECT_EQ(RowsOf(RefineByGicp({}, target, PointTree(target.points), guess, {}).pose), RowsOf(guess));
}

TEST(Fitness, IsTheShareOfPointsNearTheTarget) {
  const SurfaceCloud target{{{0, 0, 0}, {0, 0, 10}, {0, 0, 20}}, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  const PointTree tree(target.points);
  const std::vector<Eigen::Vector3d> points{{0.3, 0, 0}, {0, 0, 10.4}, {0, 0, 20.2}, {0, 1.5, 1}, {0, 0, 5}};
  const Fit fit = FitOf(points, target, tree, Coverage(target.points), Pose::Identity(), 0.5);
  EXPECT_EQ(fit.inliers, 3U);
  // The last point lies where the target knows nothing.
  EXPECT_DOUBLE_EQ(fit.fitness, 0.75);
  EXPECT_DOUBLE_EQ(fit.coverage, 0.8);
  // The first two inliers are off their planes, by 0.3 and 0 m; the third by 0.2 m.
  EXPECT_DOUBLE_EQ(fit.precision, 1.0 / 3);
  EXPECT_NEAR(fit.observability, 1.0 / 3, 1e-12);
  const Fit plane =
      FitOf(std::vector{points[0], points[1]}, target, tree, Coverage(target.points), Pose::Identity(), 0.5);
  EXPECT_NEAR(plane.observability, 0, 1e-12);
  EXPECT_EQ(FitOf({}, target, tree, Coverage(target.points), Pose::Identity(), 0.5).inliers, 0U);
}

}  // namespace
}  // namespace mapkeep
