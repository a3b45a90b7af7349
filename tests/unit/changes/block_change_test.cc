#include "core/changes/block_change.h"

#include <gtest/gtest.h>

namespace mapkeep {
namespace {

Voxel VoxelAt(uint16_t position, int hits, int exposures, bool is_static = true) {
  return {.position = position,
          .hits = static_cast<uint16_t>(kCountScale * hits),
          .exposures = static_cast<uint16_t>(kCountScale * exposures),
          .is_static = is_static,
          .mask = 1};
}

BlockChange Compare(const std::vector<Voxel>& before, const std::vector<Voxel>& after) {
  const Block a{BlockKey{7}, before}, b{BlockKey{7}, after};
  return CompareBlocks(BlockKey{7}, &a, &b, {});
}

TEST(BlockChange, WhatIsStaticInOneStateAloneAppearedOrDisappeared) {
  const BlockChange change = Compare({VoxelAt(1, 9, 1), VoxelAt(2, 9, 1), VoxelAt(3, 9, 1, false)},
                                     {VoxelAt(1, 9, 1), VoxelAt(2, 9, 1, false), VoxelAt(3, 9, 1), VoxelAt(4, 9, 1)});
  EXPECT_EQ(change.appeared.voxels, (std::vector{VoxelAt(3, 9, 1), VoxelAt(4, 9, 1)}));
  EXPECT_EQ(change.disappeared.voxels, (std::vector{VoxelAt(2, 9, 1)}));
  EXPECT_TRUE(change.unstable.voxels.empty());
  EXPECT_EQ(change.appeared.key, BlockKey{7});
}

TEST(BlockChange, ABlockThatOneStateHasNotCounts) {
  const Block block{BlockKey{7}, {VoxelAt(1, 9, 1)}};
  EXPECT_EQ(CompareBlocks(block.key, nullptr, &block, {}).appeared, block);
  EXPECT_EQ(CompareBlocks(block.key, &block, nullptr, {}).disappeared, block);
  EXPECT_TRUE(CompareBlocks(block.key, nullptr, nullptr, {}).empty());
}

TEST(BlockChange, WhatIsNewHasAppearedThoughItIsNotStaticYet) {
  Voxel waits = VoxelAt(1, 9, 1, false);
  waits.is_new = true;
  EXPECT_EQ(Compare({}, {waits}).appeared.voxels, std::vector{waits});
  EXPECT_TRUE(Compare({waits}, {VoxelAt(1, 18, 2)}).empty()) << "a second session met it: told already";
  EXPECT_EQ(Compare({waits}, {}).disappeared.voxels, std::vector{waits});
}

TEST(BlockChange, WhatStaysStaticWhileItsRFallsIsUnstable) {
  const BlockChange change = Compare({VoxelAt(1, 10, 0), VoxelAt(2, 10, 0)}, {VoxelAt(1, 6, 4), VoxelAt(2, 9, 1)});
  EXPECT_EQ(change.unstable.voxels, (std::vector{VoxelAt(1, 6, 4)})) << "from 1 to 0.6; from 1 to 0.9 is firm";
  EXPECT_TRUE(change.appeared.voxels.empty() && change.disappeared.voxels.empty());
}

TEST(BlockChange, GroundIsNeverUnstable) {
  Voxel before = VoxelAt(1, 10, 0), after = VoxelAt(1, 5, 5);
  before.ground = after.ground = true;
  EXPECT_TRUE(Compare({before}, {after}).empty());
}

}  // namespace
}  // namespace mapkeep
