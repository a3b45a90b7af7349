#pragma once

#include <cstdint>
#include <vector>

#include "core/voxels/voxel_index.h"

namespace mapkeep {

/// What a session saw of a set of voxels: H and E of eq. 4, counted in scans. Columns of equal length, sorted by key,
/// no key twice. Holds every voxel that a point fell into and every voxel that was asked for.
struct Evidence {
  double voxel_size = 0;  ///< metres
  std::vector<VoxelKey> keys;
  std::vector<uint32_t> hits;       ///< scans with a point in the voxel
  std::vector<uint32_t> exposures;  ///< scans that looked through the voxel and had no point in it
};

}  // namespace mapkeep
