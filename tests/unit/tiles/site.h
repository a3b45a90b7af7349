#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/tiling/tile_tree.h"
#include "storage/map_store.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {

/// A map "m" in a real store: ground over a square of block columns, dense enough to be divided.
class Site {
 public:
  static constexpr int kColumns = 6;  ///< an axis, from block -2 on

  explicit Site(const MapStoreOptions& options = {}) : maps_(OpenMapStore(*engine_, options)) {
    EXPECT_TRUE(maps_->Create({.name = "m"}).ok());
  }

  MapStore& maps() { return *maps_; }

  /// Two layers of ground with some holes; equal seeds give equal blocks. Seen on that day since 2000.
  static Block Ground(int x, int y, uint32_t seed, uint32_t day) {
    std::mt19937 random(seed);
    Block block{BlockKeyOf({x, y, 0}), {}};
    for (uint16_t position = 0; position < 2048; ++position) {
      if (random() % 5 == 0) continue;
      Voxel voxel{.position = position, .hits = 24, .exposures = 8, .ground = true, .is_static = true};
      voxel.mask = random() & random() & 0xffff;
      voxel.mask |= 1;
      voxel.first_seen = day * 24 * 60;
      voxel.last_seen = day * 24 * 60 + 5;
      block.voxels.push_back(voxel);
    }
    return block;
  }

  uint64_t Commit(const std::string& session, std::vector<Block> blocks) {
    const auto committed = maps_->Commit(
        "m", {.session = session, .base_epoch = newest_, .blocks = [&](const Snapshot&) { return blocks; }});
    EXPECT_TRUE(committed.ok()) << committed.status();
    return newest_ = committed->epoch;
  }

  /// Ground everywhere.
  uint64_t CommitAll(uint32_t day) {
    std::vector<Block> blocks;
    for (int x = -2; x < kColumns - 2; ++x) {
      for (int y = -2; y < kColumns - 2; ++y)
        blocks.push_back(Ground(x, y, static_cast<uint32_t>(100 + 10 * x + y), day));
    }
    std::ranges::sort(blocks, {}, &Block::key);
    return Commit("all", std::move(blocks));
  }

 private:
  TestEngine engine_;
  std::unique_ptr<MapStore> maps_;
  uint64_t newest_ = 0;
};

}  // namespace mapkeep
