#include "core/tiling/tile_tree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace mapkeep {
namespace {

using testing::ElementsAre;

TileColumn Column(int32_t x, int32_t y, uint64_t voxels, int32_t lowest = 0, int32_t highest = 0) {
  return {ColumnOf(BlockKeyOf({x, y, 0})), voxels, lowest, highest};
}

std::vector<TileColumn> Sorted(std::vector<TileColumn> columns) {
  std::ranges::sort(columns, {}, &TileColumn::key);
  return columns;
}

TEST(TileTree, ASmallMapIsOneLeaf) {
  const auto tree = BuildTileTree(Sorted({Column(0, 0, 1000), Column(1, 0, 1000), Column(1, 1, 2000, -1, 2)}));
  ASSERT_EQ(tree.size(), 1U);
  EXPECT_EQ(NameOf(tree[0].id), "1_0_0");
  EXPECT_EQ(tree[0].voxels, 4000U);
  EXPECT_EQ(tree[0].bounds, (TileBounds{{0, 0, -1}, {1, 1, 2}}));
  EXPECT_EQ(tree[0].columns, 3U);
}

TEST(TileTree, ManyVoxelsAreDividedUntilTheyAreFewOrInOneColumn) {
  const auto tree = BuildTileTree(Sorted({Column(0, 0, 9000), Column(1, 0, 10), Column(2, 3, 7), Column(3, 3, 8)}));
  std::vector<std::string> names;
  for (const TileNode& node : tree) names.push_back(NameOf(node.id));
  // The upper right square holds two columns with few voxels: a leaf of level 0 or 1, by what it spans.
  EXPECT_THAT(names, ElementsAre("2_0_0", "1_0_0", "0_0_0", "0_1_0", "1_1_1"));
  EXPECT_THAT(tree[0].children, ElementsAre(1, 4));
  EXPECT_THAT(tree[1].children, ElementsAre(2, 3));
  EXPECT_EQ(tree[4].parent, 0U);
  EXPECT_EQ(tree[4].voxels, 15U);
  EXPECT_TRUE(tree[4].children.empty());
}

TEST(TileTree, NodesWithASingleChildAreLeftOut) {
  // Two dense squares far apart: nothing between the root and what lies in them.
  const auto tree = BuildTileTree(Sorted({Column(0, 0, 9000), Column(1000, 0, 9000), Column(1001, 0, 9000)}));
  std::vector<std::string> names;
  for (const TileNode& node : tree) names.push_back(NameOf(node.id));
  EXPECT_THAT(names, ElementsAre("10_0_0", "0_0_0", "1_500_0", "0_1000_0", "0_1001_0"));
}

TEST(TileTree, NothingGivesNothing) { EXPECT_TRUE(BuildTileTree({}).empty()); }

TEST(TileNodeId, NamesGoThereAndBack) {
  for (const VoxelIndex at : {VoxelIndex{0, 0, 0}, {-1, 5, 0}, {-32768, 32767, 0}, {123, -4567, 0}}) {
    for (int level = 0; level <= 16; ++level) {
      const TileNodeId node = NodeAround(ColumnOf(BlockKeyOf(at)), level);
      EXPECT_EQ(TileNodeNamed(NameOf(node)), node) << NameOf(node);
    }
  }
  EXPECT_EQ(NameOf(NodeAround(ColumnOf(BlockKeyOf({-1, 5, 0})), 2)), "2_-1_1");
}

TEST(TileNodeId, WhatIsNoNameIsNone) {
  for (const char* name : {"", "1", "1_2", "1_2_3_4", "17_0_0", "-1_0_0", "0_32768_0", "0_-32769_0", "16_0_0", "1_+2_3",
                           "01_2_3", "1_ 2_3", "1_2_x", "1_2_99999999999999", "a_b_c"}) {
    EXPECT_FALSE(TileNodeNamed(name)) << name;
  }
}

TEST(TileNodeId, TheCommonLevelIsTheLowestThatHoldsBoth) {
  const auto key = [](int32_t x, int32_t y) { return ColumnOf(BlockKeyOf({x, y, 0})); };
  EXPECT_EQ(CommonLevel(key(3, 4), key(3, 4)), 0);
  EXPECT_EQ(CommonLevel(key(2, 4), key(3, 4)), 1);
  EXPECT_EQ(CommonLevel(key(3, 4), key(4, 4)), 3);
  EXPECT_EQ(CommonLevel(key(-1, 0), key(0, 0)), 16);  // zero is where the largest squares meet
}

}  // namespace
}  // namespace mapkeep
