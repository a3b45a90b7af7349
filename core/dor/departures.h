#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/dor/exposure.h"
#include "core/voxels/voxel_grid.h"

namespace mapkeep {

/// Parameters of FindDepartures.
struct DepartureParameters {
  double voxel_size = 0.2;       ///< metres, of the grid
  int vacated_scans = 4;         ///< scans that must look through a voxel after its last hit
  int vacated_neighbours = 10;   ///< vacated voxels around one, itself included, that were left at the same time
  int confirmed_neighbours = 3;  ///< or so many vacated voxels that were confirmed as voids in two scans
  double confirm_reach = 1.2;    ///< metres, see NearVoxels: no voxel was vacated without a confirmed void so near
  double reach = 1.6;            ///< metres around such voxels in which the rest of the object is looked for
};

/// What is asked about the voxels of a grid, by id.
struct DepartureEvidence {
  std::span<const VoxelIndex> indices;
  std::span<const char> candidates;  ///< may belong to what left: was hit, and is not ground
  std::span<const char> is_dynamic;  ///< moved, as is known already
  /// Whether a voxel lies on a surface along which the sensor looked in a scan; asked from several threads at once.
  std::function<bool(uint32_t id, uint32_t scan)> is_grazed;
};

/// The voxels of what stood still for a part of the session and then drove off, or came and stayed: a car that waits at
/// a light has about as many hits as exposures, so R (eq. 4) cannot tell it from a hedge. The order of the scans can:
/// all hits come first, then all exposures, and for all voxels of the object at about the same time. What is merely
/// seen at a worse angle later is looked through here and there, not densely and not at once, and is never a confirmed
/// void. Where the void is not confirmed, since few beams look there or what left hides it, all hits come without a gap
/// and something moving is first seen beside it when they end.
///
/// Gives one flag a voxel, by id. Nothing departs if the counts do not know the order of the scans.
std::vector<char> FindDepartures(const VoxelGrid& grid, const VoxelCounts& counts, const DepartureEvidence& evidence,
                                 const DepartureParameters& parameters);

}  // namespace mapkeep
