#pragma once

#include <cstddef>
#include <cstdint>

#include "core/voxels/voxel_index.h"

namespace mapkeep {

/// P_rec of eq. 6: the probability with which a point of an isolated dynamic voxel is given back, from the voxel's R
/// and its planarity Pi_v.
double RestorationProbability(double stability, double planarity);

/// Whether the point with this index in its scan is given back: a draw decided by the arguments alone, so that it does
/// not depend on threads or on the order of the scans.
bool IsRestored(double probability, VoxelKey voxel, size_t point, uint64_t seed);

}  // namespace mapkeep
