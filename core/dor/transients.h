#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/dor/exposure.h"
#include "core/voxels/voxel_grid.h"

namespace mapkeep {

/// Parameters of FindTransients.
struct TransientParameters {
  double voxel_size = 0.2;    ///< metres, of the grid
  double reach = 0.5;         ///< metres around a voxel that are one place, 1.5 voxels at least
  int most_scans = 60;        ///< from the first to the last that hit anything there
  double clear_share = 0.04;  ///< of those, to how many the place must have been clear besides, a voxel that was hit
};

/// The voxels of places in which something was for a short while only, and which were clear besides. What moves far
/// away leaves hits that no ray comes close enough to again to be an exposure: a ball around a voxel is such a place if
/// all hits of the voxels in it (`is_part`) lie within a few scans, and rays passed it clear of anything in so many
/// other scans as the hits took time. Leaves, poles and wires are hit now and then for as long as they are in view; of
/// what comes into view for a moment only, nothing says that it was not there before.
///
/// `indices` are the voxels of the grid by id. Gives one flag a voxel, by id, of those in `candidates`. None without
/// the order of the scans.
std::vector<char> FindTransients(const VoxelGrid& grid, std::span<const VoxelIndex> indices, const VoxelCounts& counts,
                                 std::span<const char> is_part, std::span<const char> candidates,
                                 const TransientParameters& parameters);

}  // namespace mapkeep
