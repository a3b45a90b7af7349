#pragma once

#include <span>
#include <vector>

#include "core/tiling/tile_point.h"

namespace mapkeep {

/// Points divided by a level of detail.
struct ThinnedPoints {
  std::vector<TilePoint> kept, rest;
};

/// Keeps one point of each cubic cell of 2^level sub-voxels: the one with the lowest number in a fixed shuffle of all
/// places. So the points kept at a level are among those kept at every finer one, and which they are depends neither on
/// the order nor on points of other cells. Level 0 keeps everything. Order is kept.
ThinnedPoints ThinToLevel(std::span<const TilePoint> points, int level);

}  // namespace mapkeep
