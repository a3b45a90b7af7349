#include "core/changes/changed_objects.h"

#include <gtest/gtest.h>

#include <map>

namespace mapkeep {
namespace {

constexpr double kVoxelSize = 0.2;

/// A state of a map, voxel by voxel.
class State {
 public:
  int scans = 10;  ///< that hit a voxel which is added

  void Add(const VoxelIndex& at, bool ground = false, int exposures = 0) {
    voxels_[VoxelKeyOf(at)] = {.position = PositionInBlock(at),
                               .hits = static_cast<uint16_t>(kCountScale * scans),
                               .exposures = static_cast<uint16_t>(kCountScale * exposures),
                               .ground = ground,
                               .is_static = true,
                               .mean = {128, 128, 128},
                               .mask = 1};
  }
  void AddGround(int edge) {
    for (int x = 0; x < edge; ++x) {
      for (int y = 0; y < edge; ++y) Add({x, y, 0}, true);
    }
  }
  /// The skin of a box of voxels.
  void AddBox(const VoxelIndex& from, const VoxelIndex& size, int exposures = 0) {
    for (int x = 0; x < size.x; ++x) {
      for (int y = 0; y < size.y; ++y) {
        for (int z = 0; z < size.z; ++z) {
          const bool skin = x == 0 || y == 0 || z == 0 || x == size.x - 1 || y == size.y - 1 || z == size.z - 1;
          if (skin) Add({from.x + x, from.y + y, from.z + z}, false, exposures);
        }
      }
    }
  }
  const Voxel* Find(VoxelKey key) const {
    const auto found = voxels_.find(key);
    return found == voxels_.end() ? nullptr : &found->second;
  }
  std::map<BlockKey, Block> Blocks() const {
    std::map<BlockKey, Block> blocks;
    for (const auto& [key, voxel] : voxels_) {
      Block& block = blocks.try_emplace(BlockKeyOf(key), Block{BlockKeyOf(key), {}}).first->second;
      block.voxels.push_back(voxel);
    }
    return blocks;
  }

 private:
  std::map<VoxelKey, Voxel> voxels_;
};

std::vector<ChangedObject> Compare(const State& before, const State& after) {
  const std::map<BlockKey, Block> a = before.Blocks(), b = after.Blocks();
  std::map<BlockKey, BlockChange> changes;
  const auto find = [](const auto& blocks, BlockKey key) {
    const auto found = blocks.find(key);
    return found == blocks.end() ? nullptr : &found->second;
  };
  for (const auto* blocks : {&a, &b}) {
    for (const auto& [key, block] : *blocks) changes[key] = CompareBlocks(key, find(a, key), find(b, key), {});
  }
  std::vector<BlockChange> list;
  for (const auto& [key, change] : changes) list.push_back(change);
  return FindChangedObjects(
      list, [&](VoxelKey key) { return before.Find(key); }, [&](VoxelKey key) { return after.Find(key); }, kVoxelSize,
      {});
}

TEST(ChangedObjects, ACarThatCameIsOneObjectAcrossBlocks) {
  State before, after;
  before.AddGround(60);
  after = before;
  after.AddBox({20, 28, 1}, {20, 9, 7});  // over the blocks' border at 32
  const auto objects = Compare(before, after);
  ASSERT_EQ(objects.size(), 1U);
  EXPECT_EQ(objects[0].change, ChangeClass::kAppeared);
  EXPECT_TRUE(objects[0].box.min().isApprox(Eigen::Vector3d(4, 5.6, 0.2)));
  EXPECT_TRUE(objects[0].box.max().isApprox(Eigen::Vector3d(8, 7.4, 1.6)));
  EXPECT_TRUE(objects[0].centre.isApprox(Eigen::Vector3d(6, 6.5, 0.9), 0.01));
}

TEST(ChangedObjects, OneCameWhereAnotherWentBeside) {
  State before, after;
  before.AddGround(60);
  after = before;
  before.AddBox({5, 5, 1}, {20, 9, 7});
  after.AddBox({5, 15, 1}, {20, 9, 7});  // 0.2 m between them
  const auto objects = Compare(before, after);
  ASSERT_EQ(objects.size(), 2U);
  EXPECT_NE(objects[0].change, objects[1].change);
}

TEST(ChangedObjects, AWallSeenFurtherIsNoObject) {
  State before, after;
  before.AddGround(60);
  before.AddBox({0, 50, 1}, {60, 1, 10});
  after = before;
  after.AddBox({0, 50, 11}, {60, 1, 2});  // two more rows of it
  EXPECT_TRUE(Compare(before, after).empty());
}

TEST(ChangedObjects, WhatStandsWhereNobodyHadLookedHasNotAppeared) {
  State before, after;
  before.AddGround(20);
  after = before;
  after.AddBox({100, 100, 1}, {20, 9, 7});
  EXPECT_TRUE(Compare(before, after).empty());
}

// Cars in a row behind a fence, of which the upper halves are seen and no ground under them.
TEST(ChangedObjects, ACarAppearsBetweenOthersThoughTheGroundIsHidden) {
  State before, after;
  before.AddBox({0, 0, 5}, {9, 20, 4});
  before.AddBox({30, 0, 5}, {9, 20, 4});
  after = before;
  after.AddBox({15, 0, 5}, {9, 20, 4});
  const auto objects = Compare(before, after);
  ASSERT_EQ(objects.size(), 1U);
  EXPECT_EQ(objects[0].change, ChangeClass::kAppeared);
  EXPECT_EQ(objects[0].in_view, 0);
}

TEST(ChangedObjects, WhatComesIntoViewBehindTheLastThingKnownHasNotAppeared) {
  State before, after;
  before.AddBox({0, 0, 5}, {9, 20, 4});
  after = before;
  after.AddBox({15, 0, 5}, {9, 20, 4});
  EXPECT_TRUE(Compare(before, after).empty());
}

TEST(ChangedObjects, ACarThatIsHalfGoneIsOneObject) {
  State before, after;
  before.AddGround(60);
  after = before;
  before.AddBox({5, 5, 1}, {20, 9, 7});
  after.AddBox({5, 5, 1}, {20, 9, 3}, 10);  // its lower part is still there, with R at a half
  const auto objects = Compare(before, after);
  ASSERT_EQ(objects.size(), 1U);
  EXPECT_NEAR(objects[0].box.sizes().z(), 1.4, 1e-9);
}

TEST(ChangedObjects, WhatDrovePastAndWasHitOnceInEachPlaceIsNoObject) {
  State before, after;
  before.AddGround(60);
  after = before;
  after.scans = 1;
  after.AddBox({5, 5, 1}, {40, 9, 7});
  EXPECT_TRUE(Compare(before, after).empty());
  EXPECT_TRUE(Compare(after, before).empty());
  after.scans = 3;
  after.AddBox({5, 5, 1}, {40, 9, 7});
  EXPECT_EQ(Compare(before, after).size(), 1U);
}

TEST(ChangedObjects, WhatIsNoLongerThanAGroupOfPeopleIsNoObject) {
  State before, after;
  before.AddGround(60);
  after = before;
  after.AddBox({5, 5, 1}, {5, 6, 9});
  EXPECT_TRUE(Compare(before, after).empty());
  after.AddBox({25, 25, 1}, {5, 8, 9});
  EXPECT_EQ(Compare(before, after).size(), 1U);
}

TEST(ChangedObjects, WhatSessionsContradictedCountsWithTheHitsThatItHadBefore) {
  State before, after;
  before.AddGround(60);
  after = before;
  before.AddBox({5, 5, 1}, {20, 9, 7});
  after.scans = 1;
  after.AddBox({5, 5, 1}, {20, 9, 7}, 1);
  const auto objects = Compare(before, after);
  ASSERT_EQ(objects.size(), 1U);
  EXPECT_EQ(objects[0].change, ChangeClass::kUnstable);
  EXPECT_EQ(objects[0].hits, 8);
}

TEST(ChangedObjects, SpecksAndFlatPatchesAreNoObjects) {
  State before, after;
  before.AddGround(60);
  after = before;
  after.AddBox({5, 5, 1}, {2, 2, 2});
  after.AddBox({30, 30, 1}, {12, 12, 1});
  EXPECT_TRUE(Compare(before, after).empty());
}

}  // namespace
}  // namespace mapkeep
