#include "core/voxels/block.h"

#include <gtest/gtest.h>

namespace mapkeep {
namespace {

TEST(Block, FindsAVoxelByItsPositionOrNothing) {
  const Block block{BlockKeyOf(VoxelIndex{0, 0, 0}), {{.position = 3}, {.position = 900}}};
  EXPECT_EQ(FindVoxel(block, 900), &block.voxels[1]);
  EXPECT_EQ(FindVoxel(block, 4), nullptr);
  EXPECT_EQ(FindVoxel(block, 901), nullptr);
}

TEST(Block, MeanAndSubVoxelPointsLieInTheirVoxel) {
  // Voxel (-32, 1, 2) of edge 0.2 m begins at (-6.4, 0.2, 0.4).
  const VoxelIndex index{-32, 1, 2};
  Voxel voxel{.position = PositionInBlock(index), .mean = {0, 128, 255}};
  voxel.mask = uint64_t{1} << 0 | uint64_t{1} << 63;
  const Block block{BlockKeyOf(BlockOf(index)), {voxel}};
  const Eigen::Vector3d corner(-6.4, 0.2, 0.4);
  EXPECT_TRUE(MeanOf(block, voxel, 0.2).isApprox(corner + 0.2 / 256 * Eigen::Vector3d(0.5, 128.5, 255.5), 1e-9));
  const auto points = SubVoxelPoints(block, voxel, 0.2);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_TRUE(points[0].isApprox(corner + Eigen::Vector3d::Constant(0.025), 1e-9));
  EXPECT_TRUE(points[1].isApprox(corner + Eigen::Vector3d::Constant(0.175), 1e-9));
}

TEST(Block, StabilityIsEquation4) { EXPECT_DOUBLE_EQ(Stability(3, 1, 0.5), 3 / 4.5); }

}  // namespace
}  // namespace mapkeep
