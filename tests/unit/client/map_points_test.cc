#include "client/exporters/map_points.h"

#include <gtest/gtest.h>

#include <vector>

namespace mapkeep {
namespace {

/// Voxel (0, 0, 0) of 0.2 m with two occupied sub-voxels of 0.05 m, the lowest and the highest; its mean in the middle.
Block OneVoxel() {
  const Voxel voxel{.position = 0, .mean = {127, 127, 127}, .intensity = 51, .mask = 1 | uint64_t{1} << 63};
  return {BlockKeyOf(VoxelIndex{0, 0, 0}), {voxel}};
}

std::vector<Eigen::Vector3d> PointsOf(PointDetail detail, const std::optional<Eigen::AlignedBox3d>& box) {
  std::vector<Eigen::Vector3d> points;
  ForEachPoint(OneVoxel(), 0.2, detail, box, [&points](const Eigen::Vector3d& point, const Voxel& voxel) {
    EXPECT_FLOAT_EQ(IntensityOf(voxel), 0.2F);
    points.push_back(point);
  });
  return points;
}

TEST(MapPoints, SubVoxelsAreFiveCentimetresApart) {
  const auto points = PointsOf(PointDetail::kSubVoxels, {});
  ASSERT_EQ(points.size(), 2U);
  EXPECT_TRUE(points[0].isApprox(Eigen::Vector3d::Constant(0.025)));
  EXPECT_TRUE(points[1].isApprox(Eigen::Vector3d::Constant(0.175)));
}

TEST(MapPoints, ACentroidIsTheMeanOfAVoxel) {
  const auto points = PointsOf(PointDetail::kCentroids, {});
  ASSERT_EQ(points.size(), 1U);
  EXPECT_TRUE(points[0].isApprox(Eigen::Vector3d::Constant(0.2 * 127.5 / 256)));
}

TEST(MapPoints, ABoxCutsThroughAVoxel) {
  const Eigen::AlignedBox3d low(Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(0.1));
  const auto points = PointsOf(PointDetail::kSubVoxels, low);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_TRUE(points[0].isApprox(Eigen::Vector3d::Constant(0.025)));
}

TEST(MapPoints, TheMinOfABoxIsInsideAndItsMaxIsNot) {
  const Eigen::Vector3d low = PointsOf(PointDetail::kSubVoxels, {})[0];
  const Eigen::Vector3d metre = Eigen::Vector3d::Ones();
  EXPECT_EQ(PointsOf(PointDetail::kSubVoxels, Eigen::AlignedBox3d(low, low + metre)).size(), 2U);
  EXPECT_EQ(PointsOf(PointDetail::kSubVoxels, Eigen::AlignedBox3d(low - metre, low)).size(), 0U);
}

}  // namespace
}  // namespace mapkeep
