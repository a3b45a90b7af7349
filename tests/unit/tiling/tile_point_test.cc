#include "core/tiling/tile_point.h"

#include <gtest/gtest.h>

namespace mapkeep {
namespace {

TEST(TilePoint, EveryOccupiedSubVoxelIsAPointWithWhatItsVoxelKnows) {
  const VoxelIndex index{-32, 1, 2};
  Voxel voxel{.position = PositionInBlock(index),
              .hits = 3 * kCountScale,
              .exposures = kCountScale,
              .ground = true,
              .is_static = true,
              .normal = {128, 129},
              .intensity = 77};
  voxel.mask = uint64_t{1} << 0 | uint64_t{1} << 63;
  voxel.first_seen = 24 * 60 * 9000 + 17;
  const Block block{BlockKeyOf(BlockOf(index)), {voxel}};
  std::vector<TilePoint> points;
  AppendPoints(block, {.eta = 1e-9}, points);
  ASSERT_EQ(points.size(), 2U);
  const TilePoint first{.x = -128,
                        .y = 4,
                        .z = 8,
                        .normal = {128, 129},
                        .intensity = 77,
                        .stability = 191,  // 0.75 of 255
                        .first_seen_day = 9000,
                        .ground = true};
  TilePoint last = first;
  last.x += 3;
  last.y += 3;
  last.z += 3;
  EXPECT_EQ(points[0], first);
  EXPECT_EQ(points[1], last);
}

TEST(TilePoint, WhatIsNotStaticIsLeftOutUnlessItIsAskedFor) {
  const Block block{BlockKeyOf(VoxelIndex{0, 0, 0}), {{.position = 5, .mask = 1}}};
  std::vector<TilePoint> points;
  AppendPoints(block, {}, points);
  EXPECT_TRUE(points.empty());
  AppendPoints(block, {.static_only = false}, points);
  EXPECT_EQ(points.size(), 1U);
}

}  // namespace
}  // namespace mapkeep
