#include "core/registration/up_direction.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

namespace mapkeep {
namespace {

constexpr double kRadian = std::numbers::pi / 180;

/// Patches that face `normal` within about a degree.
void Add(std::vector<SurfacePatch>& patches, int count, const Eigen::Vector3d& normal, bool below) {
  static std::mt19937 random(1);
  std::normal_distribution<double> noise(0, kRadian);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d off(noise(random), noise(random), noise(random));
    patches.push_back({(normal + off).normalized(), below});
  }
}

double DegreesBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) / kRadian;
}

const Eigen::Vector3d kX = Eigen::Vector3d::UnitX(), kY = Eigen::Vector3d::UnitY(), kZ = Eigen::Vector3d::UnitZ();

TEST(UpDirection, IsTheGroundsNormalWhereThereAreNoWalls) {
  const Eigen::Vector3d up = Eigen::AngleAxisd(7 * kRadian, kX) * kZ;
  std::vector<SurfacePatch> patches;
  Add(patches, 2000, up, true);
  const auto found = EstimateUpDirection(patches, kZ);
  ASSERT_TRUE(found);
  EXPECT_LT(DegreesBetween(*found, up), 0.2);
}

TEST(UpDirection, WallsStayUprightOnASlope) {
  // A road that climbs at 8 degrees between upright facades, and cross walls.
  std::vector<SurfacePatch> patches;
  Add(patches, 3000, Eigen::AngleAxisd(-8 * kRadian, kY) * kZ, true);
  Add(patches, 800, kY, false);
  Add(patches, 800, -kY, true);
  Add(patches, 300, kX, false);
  const auto found = EstimateUpDirection(patches, kZ);
  ASSERT_TRUE(found);
  EXPECT_LT(DegreesBetween(*found, kZ), 1.0);
}

TEST(UpDirection, BushesAndRoofsDoNotTiltIt) {
  std::vector<SurfacePatch> patches;
  Add(patches, 2000, kZ, true);
  Add(patches, 600, Eigen::AngleAxisd(25 * kRadian, kX) * kZ, true);
  Add(patches, 400, kY, false);
  const auto found = EstimateUpDirection(patches, kZ);
  ASSERT_TRUE(found);
  EXPECT_LT(DegreesBetween(*found, kZ), 0.5);
}

TEST(UpDirection, AFrameOnItsSideIsFoundByTheSensorsOwnUp) {
  // Camera axes: y down, z ahead.
  std::vector<SurfacePatch> patches;
  Add(patches, 3000, -kY, true);
  Add(patches, 500, kX, false);
  Add(patches, 300, -kZ, false);
  const auto found = EstimateUpDirection(patches, -kY);
  ASSERT_TRUE(found);
  EXPECT_LT(DegreesBetween(*found, -kY), 0.5);
}

TEST(UpDirection, IsUnknownWithoutGround) {
  EXPECT_FALSE(EstimateUpDirection({}, kZ));
  std::vector<SurfacePatch> walls;
  Add(walls, 3000, kX, false);
  EXPECT_FALSE(EstimateUpDirection(walls, kZ));
}

}  // namespace
}  // namespace mapkeep
