#include "core/registration/window_cloud.h"

#include <gtest/gtest.h>

#include "tests/unit/registration/scene.h"

namespace mapkeep {
namespace {

constexpr double kVoxel = 0.3;

TEST(WindowCloud, GivesAScanThatIsTooSparseTheNormalsOfTheWindow) {
  std::mt19937 random(3);
  const auto all = ThinPoints(SampleOf({{{-10, -10, 0.1}, {20, 0, 0}, {0, 20, 0}}}, 60, random), kVoxel);
  const WindowCloud window(all, kVoxel);
  // A ring of it: points on a line, which have no plane of their own.
  std::vector<Eigen::Vector3d> ring;
  for (const Eigen::Vector3d& point : all) {
    if (std::abs(point.x() - 2) < 0.2) ring.push_back(point);
  }
  const SurfaceCloud scan = window.SurfacesOf(ring);
  ASSERT_GT(scan.points.size(), 20U);
  for (const Eigen::Vector3d& normal : scan.normals) EXPECT_GT(std::abs(normal.z()), 0.95);
}

TEST(WindowCloud, LeavesWhatTheWindowNeverSawWithoutANormal) {
  std::mt19937 random(3);
  const auto all = ThinPoints(SampleOf({{{-10, -10, 0.1}, {20, 0, 0}, {0, 20, 0}}}, 60, random), kVoxel);
  const SurfaceCloud scan = WindowCloud(all, kVoxel).SurfacesOf(std::vector<Eigen::Vector3d>{{0, 0, 30}});
  ASSERT_EQ(scan.points.size(), 1U);
  EXPECT_TRUE(scan.normals[0].isZero());
}

TEST(WindowCloud, SamplesAllOfTheSubmap) {
  std::vector<Eigen::Vector3d> line;
  for (int i = 0; i < 25000; ++i) line.emplace_back(i, 0, 0);
  const WindowCloud window(line, kVoxel);
  EXPECT_LT(window.sample().size(), 10000U);
  EXPECT_GT(window.sample().size(), 5000U);
  EXPECT_LT(window.sample().front().x(), 5);
  EXPECT_GT(window.sample().back().x(), 24990);
  // What is small is looked at whole.
  EXPECT_EQ(WindowCloud(std::span(line).first(400), kVoxel).sample().size(), 400U);
}

TEST(WindowCloud, OfNothingIsEmpty) {
  EXPECT_TRUE(WindowCloud({}, kVoxel).empty());
  EXPECT_TRUE(WindowCloud({}, kVoxel).SurfacesOf({}).points.empty());
}

}  // namespace
}  // namespace mapkeep
