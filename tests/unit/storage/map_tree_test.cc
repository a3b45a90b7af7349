// The versioned map against a plain std::map, under random commits.

#include "storage/map_tree.h"

#include <gmock/gmock.h>

#include <map>

#include "storage/map_rows.h"
#include "storage/map_store.h"
#include "tests/unit/storage/random_blocks.h"
#include "tests/unit/storage/status_matchers.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

using Reference = std::map<BlockKey, Block>;

/// Everything that the snapshot says, against what it should say.
void ExpectSame(const Snapshot& snapshot, const Reference& reference) {
  MapTotals totals;
  std::map<TileKey, std::vector<BlockKey>> tiles;
  for (const auto& [key, block] : reference) {
    totals.voxels += block.voxels.size();
    totals.static_voxels += std::ranges::count_if(block.voxels, [](const Voxel& voxel) { return voxel.is_static; });
    ++totals.blocks;
    tiles[TileKeyOf(key)].push_back(key);
  }
  totals.tiles = tiles.size();
  EXPECT_EQ(snapshot.totals(), totals);
  std::vector<TileKey> tile_keys;
  for (const auto& [tile, blocks] : tiles) {
    tile_keys.push_back(tile);
    EXPECT_EQ(*snapshot.BlocksOf(tile), blocks);
  }
  EXPECT_EQ(*snapshot.Tiles(std::nullopt), tile_keys);
  EXPECT_EQ(snapshot.bounds().has_value(), !reference.empty());
  for (const auto& [key, block] : reference) {
    const auto read = snapshot.Read(key);
    ASSERT_DONE(read);
    ASSERT_NE(*read, nullptr);
    EXPECT_EQ(**read, block);
    const VoxelIndex at = BlockIndexOf(key);
    EXPECT_LE(snapshot.bounds()->first.z, at.z);
    EXPECT_GE(snapshot.bounds()->last.x, at.x);
  }
}

class MapTreeTest : public testing::TestWithParam<size_t> {};

TEST_P(MapTreeTest, EveryEpochOfManyReadsLikeASimpleMapOfItsTime) {
  std::mt19937_64 random(1);
  TestEngine engine;
  const auto maps = OpenMapStore(*engine, {.block_cache_bytes = GetParam()});
  ASSERT_DONE(maps->Create({.name = "m"}));
  // Blocks near each other, so that commits meet, and at the corners of the range.
  std::vector<BlockKey> pool;
  for (int i = 0; i < 60; ++i) {
    const auto near = [&random] { return static_cast<int32_t>(random() % 12) - 6; };
    pool.push_back(BlockKeyOf(VoxelIndex{near(), near(), near() / 3}));
  }
  for (const int32_t x : {-32768, 32767}) {
    for (const int32_t y : {-32768, 32767}) pool.push_back(BlockKeyOf(VoxelIndex{x, y, x}));
  }
  std::vector<Reference> epochs = {{}};
  for (int commit = 0; commit < 60; ++commit) {
    Reference next = epochs.back();
    std::map<BlockKey, Block> changes;
    for (size_t i = random() % 8 + 1; i > 0; --i) {
      const BlockKey key = pool[random() % pool.size()];
      const bool gone = random() % 3 == 0;
      changes[key] = gone ? Block{key, {}} : RandomBlock(key, random() % 20 + 1, random);
      if (gone) {
        next.erase(key);
      } else {
        next[key] = changes[key];
      }
    }
    std::vector<Block> blocks;
    for (const auto& [key, block] : changes) blocks.push_back(block);
    std::ranges::shuffle(blocks, random);
    const CommitRequest request{.session = std::to_string(commit), .blocks = [&](const Snapshot&) { return blocks; }};
    ASSERT_DONE(maps->Commit("m", request));
    epochs.push_back(next);
  }
  for (size_t epoch = 0; epoch < epochs.size(); ++epoch) {
    const auto snapshot = maps->Open("m", epoch);
    ASSERT_DONE(snapshot);
    ExpectSame(**snapshot, epochs[epoch]);
  }
}

INSTANTIATE_TEST_SUITE_P(CacheBytes, MapTreeTest, testing::Values(0, 100000, size_t{256} << 20));

TEST(MapTree, ACommitWritesNoMoreIntoALargeMapThanIntoASmallOne) {
  // The same change to maps of 1 and of 10,000 blocks in the same area and far beyond.
  std::vector<size_t> written;
  for (const int32_t side : {1, 100}) {
    TestEngine engine;
    const auto maps = OpenMapStore(*engine, {});
    const MapRecord map = *maps->Create({.name = "m"});
    std::vector<Block> ground;
    for (int32_t x = 0; x < side; ++x) {
      for (int32_t y = 0; y < side; ++y) {
        ground.push_back({BlockKeyOf(VoxelIndex{16 * x, 16 * y, 0}), {{.position = 1}}});
      }
    }
    const CommitRequest first{.session = "a", .blocks = [&](const Snapshot&) { return ground; }};
    ASSERT_DONE(maps->Commit("m", first));
    MapCaches caches(1 << 20);
    const MapValues values(*engine, caches, map.incarnation);
    const auto head = ReadRow(*engine, HeadPartition(map.incarnation), kHeadRow, DecodeEpoch);
    const BlockKey key = ground[0].key;
    const std::vector<TreeChange> change = {{key, BlockChild(key, {1, 0}, 2, 0)}};
    const auto edit = EditTree(values, (*head)->value.root, change, {1, 0});
    ASSERT_DONE(edit);
    EXPECT_EQ(edit->written.size(), 5U) << "one node a level";
    EXPECT_EQ(edit->superseded.size(), 6U) << "as many, and the block";
    size_t bytes = 0;
    for (const auto& [name, node] : edit->written) bytes += EncodeNode(*node).size();
    written.push_back(bytes);
  }
  EXPECT_LT(written[1], 8000U);
}

TEST(MapTree, ADamagedNodeIsNoticedWhereverItIsDamaged) {
  TreeNode node{1, 5, {}};
  for (uint32_t slot = 0; slot < 20; ++slot) {
    node.children.push_back({3 * slot, {slot, 0}, {slot, slot, 1, 1}, {{-1, -2, -3}, {4, 5, 6}}});
  }
  const ValueName name{ValueKind{1}, 5, {}};
  const std::string value = EncodeNode(node);
  ASSERT_DONE(DecodeNode(value, name));
  EXPECT_EQ(DecodeNode(value, name)->children, node.children);
  EXPECT_CODE(DecodeNode(value, {ValueKind{2}, 5, {}}), kDataLoss);
  EXPECT_CODE(DecodeNode(value, {ValueKind{1}, 6, {}}), kDataLoss);
  for (size_t at = 0; at < value.size(); ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = value;
      damaged[at] = static_cast<char>(damaged[at] ^ (1 << bit));
      ASSERT_CODE(DecodeNode(damaged, name), kDataLoss) << "byte " << at << " bit " << bit;
    }
    ASSERT_CODE(DecodeNode(std::string_view(value).substr(0, at), name), kDataLoss) << at;
  }
}

}  // namespace
}  // namespace mapkeep
