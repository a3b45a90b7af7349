#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/voxels/voxel_index.h"

namespace mapkeep {

/// The geometry of one voxel, from which the normals of its neighbourhood are estimated.
struct Surfel {
  VoxelKey key{};
  Eigen::Vector3f mean;            ///< of its points, in voxel edges from the voxel's corner, [0, 1) an axis
  uint64_t mask = 0;               ///< as Voxel::mask
  Eigen::Vector3f towards_sensor;  ///< any length: the side from which the voxel was seen
};

/// One oriented normal a surfel, as Voxel::normal; `surfels` sorted by key. The normal is that of the plane through the
/// surfels whose means lie within `radius_voxels` edges (at most 2) of this one's, each weighted with its occupied
/// sub-voxels and spread as they are; {0, 0} where they make a line or a point rather than a surface. It points to the
/// side of `towards_sensor`. Parallel on the calling oneTBB arena, with the same result on any number of threads.
std::vector<std::array<uint8_t, 2>> EstimateNormals(std::span<const Surfel> surfels, double radius_voxels);

}  // namespace mapkeep
