#include "core/voxels/voxel_index.h"

#include <gtest/gtest.h>

#include <random>

namespace mapkeep {
namespace {

TEST(VoxelIndex, FloorsAlsoBelowZero) {
  EXPECT_EQ(*VoxelIndexOf(Eigen::Vector3d(0.1, -0.1, -0.2), 0.2), (VoxelIndex{0, -1, -1}));
  EXPECT_EQ(*VoxelIndexOf(Eigen::Vector3d(12.9, 6.4, -6.5), 0.2), (VoxelIndex{64, 32, -33}));
}

TEST(VoxelIndex, RefusesWhatDoesNotFitIn21Bits) {
  EXPECT_TRUE(VoxelIndexOf(Eigen::Vector3d(kVoxelLimit * 0.5 - 0.1, 0, 0), 0.5).ok());
  EXPECT_TRUE(absl::IsOutOfRange(VoxelIndexOf(Eigen::Vector3d(kVoxelLimit * 0.5, 0, 0), 0.5).status()));
  EXPECT_TRUE(VoxelIndexOf(Eigen::Vector3d(0, -kVoxelLimit * 0.5, 0), 0.5).ok());
  EXPECT_TRUE(absl::IsOutOfRange(VoxelIndexOf(Eigen::Vector3d(0, -kVoxelLimit * 0.5 - 0.1, 0), 0.5).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(VoxelIndexOf(Eigen::Vector3d(0, std::nan(""), 0), 0.5).status()));
  EXPECT_TRUE(absl::IsOutOfRange(VoxelIndexOf(Eigen::Vector3d(1e300, 0, 0), 0.5).status()));
}

TEST(VoxelIndex, KeysComeBackAsTheIndicesTheyWereMadeOf) {
  std::mt19937 random(1);
  std::uniform_int_distribution<int32_t> any(-kVoxelLimit, kVoxelLimit - 1);
  for (int i = 0; i < 1000; ++i) {
    const VoxelIndex voxel{any(random), any(random), any(random)};
    const VoxelKey key = VoxelKeyOf(voxel);
    ASSERT_EQ(VoxelIndexOf(key), voxel);
    const VoxelIndex block = BlockOf(voxel);
    ASSERT_EQ(BlockIndexOf(BlockKeyOf(key)), block);
    ASSERT_EQ(TileIndexOf(TileKeyOf(BlockKeyOf(key))), (VoxelIndex{block.x >> 2, block.y >> 2, 0}));
    ASSERT_EQ(VoxelKeyOf(BlockKeyOf(block), PositionInBlock(voxel)), key);
  }
}

TEST(VoxelIndex, BlocksOfATileAreOneContiguousKeyRange) {
  const TileKey tile = TileKeyOf(VoxelIndex{-3, 7, 0});
  uint64_t lowest = UINT64_MAX, highest = 0;
  for (int x = -12; x < -8; ++x) {
    for (int y = 28; y < 32; ++y) {
      for (const int z : {-kVoxelLimit / kBlockSize, -1, 0, kVoxelLimit / kBlockSize - 1}) {
        const BlockKey key = BlockKeyOf(VoxelIndex{x, y, z});
        EXPECT_EQ(TileKeyOf(key), tile);
        lowest = std::min(lowest, static_cast<uint64_t>(key));
        highest = std::max(highest, static_cast<uint64_t>(key));
      }
    }
  }
  EXPECT_EQ(highest - lowest, (uint64_t{1} << 20) - 1);
}

TEST(VoxelIndex, TheNeighbourhoodHasTheBlockInItsMiddle) {
  const auto around = NeighbourhoodOf({5, -1, 0});
  EXPECT_EQ(around[13], (VoxelIndex{5, -1, 0}));
  EXPECT_EQ(around[0], (VoxelIndex{4, -2, -1}));
  EXPECT_EQ(around[14], (VoxelIndex{6, -1, 0}));
  EXPECT_EQ(around[26], (VoxelIndex{6, 0, 1}));
}

}  // namespace
}  // namespace mapkeep
