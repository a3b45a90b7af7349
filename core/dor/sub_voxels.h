#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>

#include "core/voxels/voxel_index.h"

namespace mapkeep {

/// Whether the ray from + t along, t in [enter, leave], the stretch inside the voxel with the given lowest corner,
/// passes through a sub-voxel (a quarter of the edge) that is set in the mask (bit x + 4 y + 16 z). Lengths in voxel
/// edges. The stretch is sampled, at most a fifth of a sub-voxel apart in each axis' steps of a diagonal, so that it
/// may miss a corner that the ray only clips.
inline bool PassesSubVoxels(uint64_t mask, const VoxelIndex& voxel, const Eigen::Vector3d& from,
                            const Eigen::Vector3d& along, double enter, double leave) {
  constexpr int kSamples = 12;
  const Eigen::Vector3d start = 4 * (from + enter * along - Eigen::Vector3d(voxel.x, voxel.y, voxel.z));
  const Eigen::Vector3d step = 4 * (leave - enter) / kSamples * along;
  for (int i = 0; i < kSamples; ++i) {
    const Eigen::Vector3d at = start + (i + 0.5) * step;
    const int x = std::clamp(static_cast<int>(at.x()), 0, 3);
    const int y = std::clamp(static_cast<int>(at.y()), 0, 3);
    const int z = std::clamp(static_cast<int>(at.z()), 0, 3);
    if ((mask >> (x + 4 * y + 16 * z) & 1) != 0) return true;
  }
  return false;
}

}  // namespace mapkeep
