#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/dor/exposure.h"
#include "core/voxels/voxel_grid.h"

namespace mapkeep {

/// Parameters of FindDriveOffs.
struct DriveOffParameters {
  double voxel_size = 0.2;  ///< metres, of the grid
  int setting_out = 7;      ///< scans that what sets out takes for its first two metres or so, at least
};

/// The voxels of what stood until something set out beside it: a parked car that drives off where no beam looks again
/// has no exposures, and departures (FindDepartures) know nothing of it. But the car itself is seen on its way. So what
/// stands (`is_static`) drove off if
/// - its voxels hang together, are about as large as a car, and none of them was hit after a time T;
/// - what moved (`is_dynamic`) was first seen beside it at T, and then farther and farther away in the one direction,
/// as
///   slowly as what starts from rest: whoever merely drives by is sooner gone.
/// What it touches and was hit after T, a car in the same row, keeps what is nearer to it than to where something set
/// out.
///
/// `indices` are the voxels of the grid by id. Gives one flag a voxel, by id. Nothing drives off if the counts do not
/// know the order of the scans.
std::vector<char> FindDriveOffs(const VoxelGrid& grid, std::span<const VoxelIndex> indices, const VoxelCounts& counts,
                                std::span<const char> is_static, std::span<const char> is_dynamic,
                                const DriveOffParameters& parameters);

}  // namespace mapkeep
