#pragma once

#include <absl/container/flat_hash_map.h>

#include <cstdint>
#include <span>
#include <vector>

#include "core/dor/exposure.h"
#include "core/dor/parameters.h"
#include "core/dor/remover.h"
#include "core/geometry/pose.h"
#include "core/voxels/voxel_grid.h"

namespace mapkeep {

/// What section 3.3 decides about a voxel.
enum class VoxelVerdict : uint8_t {
  kStatic,
  kGround,
  kDynamic,
  kAnkle,     ///< ground with something dynamic on it: its points above a height are removed
  kIsolated,  ///< dynamic without a dynamic neighbour: its points come back with a probability (eq. 6)
};

/// The verdict on every voxel of a grid, by id.
struct Verdict {
  std::vector<VoxelVerdict> voxels;
  absl::flat_hash_map<uint32_t, double> ankle_heights;          ///< of kAnkle: points above it go, metres
  absl::flat_hash_map<uint32_t, double> restore_probabilities;  ///< P_rec of kIsolated
};

/// The label of a point in the voxel with this id: its height in metres, and its index in its scan.
PointLabel LabelOf(const Verdict& verdict, uint32_t id, const VoxelIndex& voxel, double height, size_t point,
                   uint64_t seed);

/// Section 3.3 from the counts on. `poses` are those of the scans.
Verdict Judge(const SessionVoxels& voxels, const VoxelCounts& counts, std::span<const Pose> poses,
              const DorParameters& parameters);

}  // namespace mapkeep
