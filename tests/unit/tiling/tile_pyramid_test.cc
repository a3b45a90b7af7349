#include "core/tiling/tile_pyramid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <tuple>

#include "core/tiling/thinning_levels.h"

namespace mapkeep {
namespace {

using Place = std::tuple<int32_t, int32_t, int32_t>;

// Ground over some squares about zero, dense here and sparse there, with a wall, in order of key.
std::vector<Block> Site() {
  std::mt19937 random(3);
  std::map<BlockKey, Block> blocks;
  for (int bx = -6; bx < 7; ++bx) {
    for (int by = -3; by < 9; ++by) {
      if ((bx + 2 * by) % 5 == 0) continue;
      const int every = bx > 2 ? 40 : 1;
      for (const int bz : {0, 1}) {
        if (bz == 1 && bx != 0) continue;
        Block block{BlockKeyOf({bx, by, bz}), {}};
        for (int position = 0; position < 1024; position += every) {
          Voxel voxel{.position = static_cast<uint16_t>(position), .hits = 8, .is_static = position % 7 != 3};
          voxel.mask = uint64_t{random() & random() & random()} << 20 | 1;
          block.voxels.push_back(voxel);
        }
        blocks[block.key] = block;
      }
    }
  }
  std::vector<Block> sorted;
  for (auto& [key, block] : blocks) sorted.push_back(std::move(block));
  return sorted;
}

struct Made {
  std::map<TileNodeId, std::vector<TilePoint>> tiles;
  std::vector<TileNode> tree;
};

Made Make(const std::vector<Block>& blocks, const PointSelection& selection = {}) {
  Made made;
  TilePyramid pyramid(selection, [&made](const TileNodeId& node, std::span<const TilePoint> points) {
    EXPECT_TRUE(made.tiles.emplace(node, std::vector<TilePoint>(points.begin(), points.end())).second);
    return absl::OkStatus();
  });
  for (const Block& block : blocks) EXPECT_TRUE(pyramid.Add(block).ok());
  auto tree = pyramid.Finish();
  EXPECT_TRUE(tree.ok());
  made.tree = *std::move(tree);
  return made;
}

std::vector<TileColumn> ColumnsOf(const std::vector<Block>& blocks) {
  std::vector<TileColumn> columns;
  for (const Block& block : blocks) {
    const auto voxels = static_cast<uint64_t>(std::ranges::count_if(block.voxels, &Voxel::is_static));
    if (voxels == 0) continue;
    const int32_t z = BlockIndexOf(block.key).z;
    if (columns.empty() || columns.back().key != ColumnOf(block.key)) columns.push_back({ColumnOf(block.key), 0, z, z});
    columns.back().voxels += voxels;
    columns.back().highest = z;
  }
  return columns;
}

TEST(TilePyramid, EveryPointIsInExactlyOneTile) {
  const std::vector<Block> blocks = Site();
  std::vector<TilePoint> all;
  for (const Block& block : blocks) AppendPoints(block, {}, all);
  std::set<Place> in_map, in_tiles;
  for (const TilePoint& p : all) in_map.insert({p.x, p.y, p.z});
  size_t count = 0;
  const Made made = Make(blocks);
  for (const auto& [node, points] : made.tiles) {
    count += points.size();
    for (const TilePoint& p : points) in_tiles.insert({p.x, p.y, p.z});
  }
  EXPECT_EQ(count, all.size());
  EXPECT_EQ(in_tiles, in_map);
  EXPECT_GT(made.tiles.size(), 20U);
}

TEST(TilePyramid, MakesTheTreeThatColumnsMake) {
  const std::vector<Block> blocks = Site();
  const Made made = Make(blocks);
  const std::vector<TileNode> tree = BuildTileTree(ColumnsOf(blocks));
  ASSERT_EQ(made.tree.size(), tree.size());
  for (size_t i = 0; i < tree.size(); ++i) {
    EXPECT_EQ(made.tree[i].id, tree[i].id);
    EXPECT_EQ(made.tree[i].voxels, tree[i].voxels);
    EXPECT_EQ(made.tree[i].bounds, tree[i].bounds);
    EXPECT_EQ(made.tree[i].children, tree[i].children);
    EXPECT_EQ(made.tree[i].parent, tree[i].parent);
    EXPECT_TRUE(made.tiles.contains(tree[i].id));
  }
}

TEST(TilePyramid, ATileAndThoseAboveItShowItsSquareAtItsLevel) {
  const std::vector<Block> blocks = Site();
  const Made made = Make(blocks);
  std::vector<TilePoint> all;
  for (const Block& block : blocks) AppendPoints(block, {}, all);
  for (const TileNode& node : made.tree) {
    const auto inside = [&node](const TilePoint& p) {
      const VoxelIndex block{p.x >> 7, p.y >> 7, 0};
      return NodeAround(ColumnOf(BlockKeyOf(block)), node.id.level) == node.id;
    };
    std::vector<TilePoint> own;
    std::ranges::copy_if(all, std::back_inserter(own), inside);
    std::set<Place> expected, shown;
    for (const TilePoint& p : ThinToLevel(own, node.children.empty() ? 0 : node.id.level).kept) {
      expected.insert({p.x, p.y, p.z});
    }
    for (std::optional<size_t> at = &node - made.tree.data(); at; at = made.tree[*at].parent) {
      for (const TilePoint& p : made.tiles.at(made.tree[*at].id)) {
        if (inside(p)) shown.insert({p.x, p.y, p.z});
      }
    }
    EXPECT_EQ(shown, expected) << NameOf(node.id);
  }
}

TEST(TilePyramid, NoTileIsLarge) {
  for (const auto& [node, points] : Make(Site()).tiles) EXPECT_LT(points.size(), 100000U) << NameOf(node);
}

TEST(TilePyramid, AMapWithoutStaticVoxelsHasNoTiles) {
  const Made made = Make({{BlockKeyOf(VoxelIndex{0, 0, 0}), {{.position = 5, .mask = 1}}}});
  EXPECT_TRUE(made.tree.empty());
  EXPECT_TRUE(made.tiles.empty());
}

TEST(TilePyramid, RefusesBlocksOutOfOrder) {
  TilePyramid pyramid({}, [](const TileNodeId&, std::span<const TilePoint>) { return absl::OkStatus(); });
  const Block block{BlockKeyOf(VoxelIndex{0, 0, 0}), {}};
  EXPECT_TRUE(pyramid.Add(block).ok());
  EXPECT_EQ(pyramid.Add(block).code(), absl::StatusCode::kInvalidArgument);
}

TEST(TilePyramid, PassesOnWhatWentWrongWithATile) {
  TilePyramid pyramid({}, [](const TileNodeId&, std::span<const TilePoint>) {
    return absl::ResourceExhaustedError("the disk is full");
  });
  absl::Status status;
  for (const Block& block : Site()) status.Update(pyramid.Add(block));
  status.Update(pyramid.Finish().status());
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace mapkeep
