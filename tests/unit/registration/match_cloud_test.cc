#include "core/registration/match_cloud.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <set>

namespace mapkeep {
namespace {

constexpr double kVoxel = 0.5;

// A square of 20 x 20 voxels at height `z`, four points a voxel, all facing the same way.
FacingPoints Floor(double z, const Eigen::Vector3d& facing) {
  FacingPoints floor;
  for (int x = 0; x < 40; ++x) {
    for (int y = 0; y < 40; ++y) {
      floor.points.emplace_back(0.25 * x + 0.125 - 5, 0.25 * y + 0.125 - 5, z);
      floor.facing.push_back(facing);
    }
  }
  return floor;
}

TEST(MatchCloud, KeepsTheMeanPointOfEachVoxelWithTheNormalOfItsPlane) {
  const MatchCloud cloud = MakeMatchCloud(Floor(0.1, {3, 1, 2}), kVoxel, 3);
  ASSERT_EQ(cloud.points.size(), 400);
  std::set<std::pair<double, double>> places;
  for (size_t i = 0; i < cloud.points.size(); ++i) {
    EXPECT_NEAR(std::remainder(cloud.points[i].x() - 0.25, 0.5), 0, 1e-12);
    EXPECT_NEAR(cloud.points[i].z(), 0.1, 1e-12);
    EXPECT_LT((cloud.normals[i] - Eigen::Vector3f::UnitZ()).norm(), 1e-4F);
    places.emplace(cloud.points[i].x(), cloud.points[i].y());
  }
  EXPECT_EQ(places.size(), 400);
}

TEST(MatchCloud, TurnsNormalsToTheSideThatThePointsFace) {
  const MatchCloud cloud = MakeMatchCloud(Floor(0.1, {3, 1, -2}), kVoxel, 3);
  ASSERT_EQ(cloud.points.size(), 400);
  for (const auto& normal : cloud.normals) EXPECT_LT((normal + Eigen::Vector3f::UnitZ()).norm(), 1e-4F);
}

TEST(MatchCloud, APointOfUnknownSideTakesThatOfItsNeighbours) {
  FacingPoints floor = Floor(0.1, Eigen::Vector3d::UnitZ());
  for (size_t i = 0; i < floor.facing.size(); i += 2) floor.facing[i].setZero();
  const MatchCloud cloud = MakeMatchCloud(floor, kVoxel, 3);
  EXPECT_EQ(cloud.points.size(), 400);
  for (const auto& normal : cloud.normals) EXPECT_GT(normal.z(), 0.99F);
}

TEST(MatchCloud, IsEmptyWhereNoSideIsKnown) {
  EXPECT_TRUE(MakeMatchCloud(Floor(0.1, Eigen::Vector3d::Zero()), kVoxel, 3).points.empty());
}

TEST(MatchCloud, LeavesOutWhatIsNotFiniteOrTooFar) {
  FacingPoints floor = Floor(0.1, Eigen::Vector3d::UnitZ());
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double odd : {kNan, kInfinity, -kInfinity, 1e9, 1e300}) {
    floor.points.emplace_back(0, odd, 0);
    floor.facing.push_back(Eigen::Vector3d::UnitZ());
  }
  floor.facing[7].setConstant(kNan);
  floor.facing[8].setConstant(1e300);
  const MatchCloud cloud = MakeMatchCloud(floor, kVoxel, 3);
  EXPECT_EQ(cloud.points.size(), 400);
  for (const auto& normal : cloud.normals) EXPECT_TRUE(normal.allFinite());
}

TEST(MatchCloud, APointOrALineHasNoNormal) {
  FacingPoints point{{{1, 2, 3}}, {{0, 0, 1}}};
  EXPECT_TRUE(MakeMatchCloud(point, kVoxel, 3).points.empty());
  FacingPoints line;
  for (int i = 0; i < 100; ++i) {
    line.points.emplace_back(0.3 * i, 0.1, 0.1);
    line.facing.emplace_back(0, 0, 1);
  }
  EXPECT_TRUE(MakeMatchCloud(line, kVoxel, 3).points.empty());
}

TEST(MatchCloud, TheRangesOfACellHoldEveryNeighbourWithinACell) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> any(-10, 10);
  FacingPoints input;
  for (int i = 0; i < 3000; ++i) {
    input.points.emplace_back(any(random), any(random), 0.2 * any(random));
    input.facing.emplace_back(0, 0, 1);
  }
  const MatchCloud cloud = MakeMatchCloud(input, kVoxel, 3);
  ASSERT_GT(cloud.points.size(), 1000);
  std::vector<PointRange> ranges;
  for (size_t cell = 0; cell < cloud.cell_keys.size(); ++cell) {
    NeighbouringRanges(cloud.cell_keys, cloud.cell_begin, cell, ranges);
    std::vector<bool> held(cloud.points.size());
    for (const PointRange& range : ranges) std::fill(held.begin() + range.begin, held.begin() + range.end, true);
    for (uint32_t i = cloud.cell_begin[cell]; i < cloud.cell_begin[cell + 1]; ++i) {
      for (size_t j = 0; j < cloud.points.size(); ++j) {
        const bool near = (cloud.points[i] - cloud.points[j]).norm() < kCellVoxels * kVoxel;
        EXPECT_TRUE(!near || held[j]) << i << " " << j;
      }
    }
  }
}

}  // namespace
}  // namespace mapkeep
