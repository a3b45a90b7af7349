#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/voxels/block.h"

namespace mapkeep {

/// One point of a tile: the centre of an occupied sub-voxel, with what its voxel knows.
struct TilePoint {
  int32_t x = 0, y = 0, z = 0;      ///< sub-voxels (a quarter of a voxel's edge) from the map's origin
  std::array<uint8_t, 2> normal{};  ///< octahedral, {0, 0}: unknown (see core/voxels/normal.h)
  uint8_t intensity = 0;            ///< 255 is 1.0
  uint8_t stability = 0;            ///< R of eq. 4, 255 is 1.0
  uint16_t first_seen_day = 0;      ///< days since 2000-01-01 UTC
  bool ground = false;

  bool operator==(const TilePoint&) const = default;
};

inline constexpr int kSubVoxelBits = 2;  ///< a voxel is 4 sub-voxels an axis

/// Which voxels become points.
struct PointSelection {
  bool static_only = true;  ///< only those that the map filter holds to be static
  double eta = 1e-3;        ///< of eq. 4, scans
};

/// Appends the block's points, in order of voxel and sub-voxel.
void AppendPoints(const Block& block, const PointSelection& selection, std::vector<TilePoint>& points);

}  // namespace mapkeep
