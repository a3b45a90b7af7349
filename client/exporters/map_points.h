#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <optional>

#include "core/voxels/block.h"

namespace mapkeep {

/// Which points of a map stand for its voxels.
enum class PointDetail : uint8_t {
  kSubVoxels,  ///< the centre of every occupied sub-voxel, a quarter of a voxel's edge
  kCentroids,  ///< the mean point of every voxel
};

/// Calls `point` for each point of the block, in order of voxel, with metres relative to the map's origin and the voxel
/// that it stands for. Of a box its min is inside, its max is not.
void ForEachPoint(const Block& block, double voxel_size, PointDetail detail,
                  const std::optional<Eigen::AlignedBox3d>& box,
                  const std::function<void(const Eigen::Vector3d& point, const Voxel& voxel)>& point);

/// The voxel's mean intensity, [0, 1].
inline float IntensityOf(const Voxel& voxel) { return static_cast<float>(voxel.intensity) / 255; }

}  // namespace mapkeep
