#include "server/tiles/tile_source.h"

#include <gtest/gtest.h>

#include <set>
#include <thread>
#include <tuple>

#include "core/tiling/gltf_points.h"
#include "core/tiling/tile_pyramid.h"
#include "tests/unit/tiles/site.h"

namespace mapkeep {
namespace {

SharedBytes TileOf(TileSource& source, const EpochTiles& tiles, size_t node, Coding coding = Coding::kIdentity) {
  auto bytes = source.Tile(tiles, node, coding);
  EXPECT_TRUE(bytes.ok()) << bytes.status();
  return *std::move(bytes);
}

std::shared_ptr<const EpochTiles> Open(TileSource& source, std::optional<uint64_t> epoch = {}) {
  auto tiles = source.Open("m", epoch);
  EXPECT_TRUE(tiles.ok()) << tiles.status();
  return *std::move(tiles);
}

TEST(TileSource, ServesTheTilesThatAnExportMakes) {
  Site site;
  site.CommitAll(8000);
  TileSource source(site.maps(), {});
  const auto tiles = Open(source);
  std::map<TileNodeId, std::string> exported;
  TilePyramid pyramid({}, [&](const TileNodeId& node, std::span<const TilePoint> points) {
    exported[node] = EncodePointTile(points, {.voxel_size = 0.2, .newest_day = 8000});
    return absl::OkStatus();
  });
  const auto snapshot = site.maps().Open("m");
  const auto keys = (*snapshot)->Tiles({});
  ASSERT_TRUE(keys.ok());
  for (const TileKey tile : *keys) {
    const auto blocks = (*snapshot)->BlocksOf(tile);
    ASSERT_TRUE(blocks.ok());
    for (const BlockKey key : *blocks) ASSERT_TRUE(pyramid.Add(**(*snapshot)->Read(key)).ok());
  }
  ASSERT_TRUE(pyramid.Finish().ok());
  ASSERT_EQ(exported.size(), tiles->tree.size());
  for (size_t i = 0; i < tiles->tree.size(); ++i) {
    EXPECT_TRUE(*TileOf(source, *tiles, i) == exported[tiles->tree[i].id]) << NameOf(tiles->tree[i].id);
  }
}

TEST(TileSource, AfterACommitOnlyWhatItChangedIsMadeAnew) {
  Site site;
  site.CommitAll(8000);
  TileSource source(site.maps(), {});
  const auto before = Open(source);
  for (size_t i = 0; i < before->tree.size(); ++i) TileOf(source, *before, i);
  const TileSourceCounts first = source.counts();
  EXPECT_EQ(first.tiles, before->tree.size());

  site.Commit("one", {Site::Ground(1, 1, 7, 8000)});
  const auto after = Open(source);
  for (size_t i = 0; i < after->tree.size(); ++i) TileOf(source, *after, i);
  const TileSourceCounts second = source.counts();
  EXPECT_LE(second.tiles - first.tiles, 4U);
  EXPECT_LE(second.squares - first.squares, 4U);
  EXPECT_LT(second.points - first.points, first.points / 4);
  // And an old epoch costs nothing.
  for (size_t i = 0; i < before->tree.size(); ++i) TileOf(source, *before, i);
  EXPECT_EQ(source.counts().tiles, second.tiles);
}

TEST(TileSource, ManyWhoAskForOneTileAtOnceGetItMadeOnce) {
  Site site;
  site.CommitAll(8000);
  TileSource source(site.maps(), {});
  const auto tiles = Open(source);
  std::vector<SharedBytes> got(8);
  {
    std::vector<std::jthread> threads;
    for (SharedBytes& bytes : got) threads.emplace_back([&] { bytes = TileOf(source, *tiles, 0); });
  }
  for (const SharedBytes& bytes : got) EXPECT_EQ(bytes, got[0]);
  EXPECT_EQ(source.counts().tiles, 1U);
}

TEST(TileSource, WithHardlyAnyMemoryItServesTheSameAndHoldsNoMore) {
  Site site;
  site.CommitAll(8000);
  TileSource source(site.maps(), {}), poor(site.maps(), {.cache_bytes = 4 << 20});
  const auto tiles = Open(source);
  for (int round = 0; round < 2; ++round) {
    for (size_t i = 0; i < tiles->tree.size(); ++i) {
      EXPECT_TRUE(*TileOf(poor, *tiles, i) == *TileOf(source, *tiles, i));
    }
  }
}

TEST(TileSource, WhatSlowClientsHoldIsLimited) {
  Site site;
  site.CommitAll(8000);
  TileSource poor(site.maps(), {.cache_bytes = 64 << 10});
  const auto tiles = Open(poor);
  std::vector<SharedBytes> held;
  absl::Status refused;
  for (size_t i = 0; i < tiles->tree.size() && refused.ok(); ++i) {
    auto bytes = poor.Tile(*tiles, i, Coding::kIdentity);
    if (bytes.ok()) held.push_back(*std::move(bytes));
    refused = bytes.status();
  }
  EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable);
  held.clear();
  EXPECT_TRUE(poor.Tile(*tiles, 0, Coding::kIdentity).ok());
}

TEST(TileSource, AnEpochThatIsNotThereIsSaid) {
  Site site;
  site.CommitAll(8000);
  TileSource source(site.maps(), {});
  EXPECT_EQ(source.Open("m", 99).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(source.Open("x", {}).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(source.FindOpen("m", 1), nullptr);
  const auto tiles = Open(source);
  EXPECT_EQ(source.FindOpen("m", 1), tiles);
}

TEST(TileSource, ATileOfAMapThatWasMadeAnewIsNotTheOldOnes) {
  Site site;
  site.CommitAll(8000);
  TileSource source(site.maps(), {});
  const auto tiles = Open(source);
  ASSERT_TRUE(site.maps().Delete("m").ok());
  ASSERT_TRUE(site.maps().Create({.name = "m"}).ok());
  EXPECT_FALSE(source.Tile(*tiles, 0, Coding::kIdentity).ok());
}

}  // namespace
}  // namespace mapkeep
