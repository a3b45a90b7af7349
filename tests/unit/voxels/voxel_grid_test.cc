#include "core/voxels/voxel_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <vector>

namespace mapkeep {
namespace {

std::vector<VoxelIndex> SomeVoxels(unsigned seed, int spread) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int32_t> any(-spread, spread);
  std::vector<VoxelIndex> voxels(5000);
  for (VoxelIndex& voxel : voxels) voxel = {any(random), any(random), any(random) / 4};
  return voxels;
}

TEST(VoxelGrid, HoldsExactlyWhatWasInsertedUnderDenseIds) {
  const auto voxels = SomeVoxels(1, 60);
  VoxelGrid grid;
  std::set<VoxelIndex> expected;
  for (const VoxelIndex& voxel : voxels) EXPECT_EQ(grid.Insert(voxel), expected.insert(voxel).second);
  grid.Finish();
  ASSERT_EQ(grid.size(), expected.size());
  std::set<uint32_t> ids;
  for (const VoxelIndex& voxel : expected) ids.insert(grid.Find(voxel));
  EXPECT_EQ(ids.size(), expected.size());
  EXPECT_EQ(*ids.rbegin(), expected.size() - 1);
  for (const VoxelIndex& voxel : SomeVoxels(2, 60)) {
    EXPECT_EQ(grid.Find(voxel) != kNoVoxel, expected.contains(voxel));
  }
}

TEST(VoxelGrid, TheEndsOfTheRangeAreHeld) {
  VoxelGrid grid;
  const VoxelIndex low{-kVoxelLimit, -kVoxelLimit, -kVoxelLimit},
      high{kVoxelLimit - 1, kVoxelLimit - 1, kVoxelLimit - 1};
  grid.Insert(low);
  grid.Insert(high);
  grid.Finish();
  EXPECT_EQ(grid.Find(low), 0U);
  EXPECT_EQ(grid.Find(high), 1U);
  EXPECT_EQ(grid.Find({0, 0, 0}), kNoVoxel);
}

TEST(VoxelGrid, IdsDoNotDependOnTheOrderOfInsertionNorOnMerging) {
  auto voxels = SomeVoxels(3, 200);
  VoxelGrid forward, backward, half;
  for (const VoxelIndex& voxel : voxels) forward.Insert(voxel);
  std::ranges::reverse(voxels);
  for (size_t i = 0; i < voxels.size(); ++i) (i % 2 == 0 ? half : backward).Insert(voxels[i]);
  backward.Merge(half);
  forward.Finish();
  backward.Finish();
  ASSERT_EQ(forward.size(), backward.size());
  for (const VoxelIndex& voxel : voxels) ASSERT_EQ(forward.Find(voxel), backward.Find(voxel));
}

TEST(VoxelGrid, BricksGiveTheirVoxelsInTheOrderOfIds) {
  VoxelGrid grid;
  for (const VoxelIndex& voxel : SomeVoxels(4, 40)) grid.Insert(voxel);
  grid.Finish();
  uint32_t next = 0;
  for (size_t brick = 0; brick < grid.brick_count(); ++brick) {
    EXPECT_EQ(grid.FirstId(static_cast<int32_t>(brick)), next);
    grid.ForEachInBrick(static_cast<int32_t>(brick), [&](uint32_t id, const VoxelIndex& voxel) {
      EXPECT_EQ(id, next++);
      EXPECT_EQ(grid.Find(voxel), id);
    });
  }
  EXPECT_EQ(next, grid.size());
}

TEST(VoxelGrid, WithinAReachItGivesWhatFindGives) {
  VoxelGrid grid;
  const auto voxels = SomeVoxels(6, 60);
  for (const VoxelIndex& voxel : voxels) grid.Insert(voxel);
  grid.Finish();
  size_t met = 0;
  for (size_t i = 0; i < 50; ++i) {
    const VoxelIndex at = voxels[i];
    std::vector<uint32_t> expected, found;
    for (int dz = -2; dz <= 2; ++dz) {
      for (int dy = -2; dy <= 2; ++dy) {
        for (int dx = -2; dx <= 2; ++dx) {
          const uint32_t id = grid.Find({at.x + dx, at.y + dy, at.z + dz});
          if (id != kNoVoxel) expected.push_back(id);
        }
      }
    }
    grid.ForEachWithin(2, at, [&](uint32_t id, int dx, int dy, int dz) {
      EXPECT_EQ(id, grid.Find({at.x + dx, at.y + dy, at.z + dz}));
      found.push_back(id);
    });
    EXPECT_EQ(found, expected);
    met += found.size();
  }
  EXPECT_GE(met, 50U) << "each meets itself at least";
}

TEST(VoxelGrid, SortsByKey) {
  VoxelGrid grid;
  for (const VoxelIndex& voxel : SomeVoxels(5, 100)) grid.Insert(voxel);
  grid.Finish();
  std::vector<VoxelKey> keys;
  std::vector<uint32_t> ids;
  grid.SortByKey(keys, ids);
  ASSERT_EQ(keys.size(), grid.size());
  EXPECT_TRUE(std::ranges::is_sorted(keys));
  for (size_t i = 0; i < keys.size(); ++i) ASSERT_EQ(grid.Find(VoxelIndexOf(keys[i])), ids[i]);
}

TEST(VoxelGrid, ClearedItIsEmptyAndUsable) {
  VoxelGrid grid;
  grid.Insert({1, 2, 3});
  grid.Clear();
  EXPECT_TRUE(grid.Insert({1, 2, 3}));
  grid.Finish();
  EXPECT_EQ(grid.size(), 1U);
}

}  // namespace
}  // namespace mapkeep
