#pragma once

#include <cstdint>
#include <span>

#include "core/geometry/pose.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// What a straightforward counting of H and E costs, to compare with: every ray of every point is walked from voxel to
/// voxel (Amanatides and Woo) into a hash set of the scan, and the sets are added up in a hash map of all voxels ever
/// touched. One thread. Gives the voxels in the map.
uint64_t CountByHashSets(std::span<const Scan> scans, std::span<const Pose> poses, double voxel_size);

/// OctoMap's insertPointCloud of every scan into one tree, with its default parameters and no limit of range. One
/// thread. Gives the leaves of the tree.
uint64_t InsertIntoOctomap(std::span<const Scan> scans, std::span<const Pose> poses, double voxel_size);

/// Steps from voxel to voxel that walking every ray takes.
uint64_t VoxelStepsOf(std::span<const Scan> scans, std::span<const Pose> poses, double voxel_size);

}  // namespace mapkeep
