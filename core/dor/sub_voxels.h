#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

#include "core/voxels/voxel_index.h"

namespace mapkeep {

inline constexpr uint64_t kFullMask = ~uint64_t{0};

/// The box around the occupied sub-voxels of a mask (bit x + 4 y + 16 z, quarters of a voxel's edge), in sub-voxels:
/// low inclusive, high exclusive.
struct MaskBox {
  std::array<int, 3> low{}, high{};

  int volume() const { return (high[0] - low[0]) * (high[1] - low[1]) * (high[2] - low[2]); }
};

/// The box of a mask that is not empty.
inline MaskBox BoxOf(uint64_t mask) {
  const uint64_t low_half = mask | mask >> 32;
  const auto layer = static_cast<uint32_t>((low_half | low_half >> 16) & 0xffff);  // all z: bit x + 4 y
  const uint32_t x = (layer | layer >> 4 | layer >> 8 | layer >> 12) & 0xf;
  MaskBox box;
  box.low = {std::countr_zero(x), std::countr_zero(layer) / 4, std::countr_zero(mask) / 16};
  box.high = {32 - std::countl_zero(x), (31 - std::countl_zero(layer)) / 4 + 1, (63 - std::countl_zero(mask)) / 16 + 1};
  return box;
}

/// A ray from the sensor, lengths in voxel edges. Its points are from + t along, t in [0, 1].
struct Ray {
  Eigen::Vector3d along;
  Eigen::Vector3d inverse;  ///< 1 / along; a huge number for 0, so that products stay defined

  explicit Ray(const Eigen::Vector3d& to_end) : along(to_end) {
    for (int axis = 0; axis < 3; ++axis) inverse[axis] = along[axis] == 0 ? 1e300 : 1 / along[axis];
  }
};

/// The occupied part of a voxel as a ray meets it. Lengths in voxel edges, relative to the sensor.
struct RayTarget {
  uint64_t mask;
  Eigen::Vector3d corner;     ///< the voxel's lowest
  Eigen::Vector3d low, high;  ///< the box around the occupied sub-voxels
  bool solid;                 ///< the box has no empty sub-voxel

  RayTarget(const VoxelIndex& voxel, uint64_t occupied, const Eigen::Vector3d& sensor)
      : mask(occupied), corner(Eigen::Vector3d(voxel.x, voxel.y, voxel.z) - sensor) {
    const MaskBox box = BoxOf(mask);
    low = corner + 0.25 * Eigen::Vector3d(box.low[0], box.low[1], box.low[2]);
    high = corner + 0.25 * Eigen::Vector3d(box.high[0], box.high[1], box.high[2]);
    solid = std::popcount(mask) == box.volume();
  }
};

/// Whether a ray passes through the target before t = end. Inside the box the ray is sampled, so that it may miss a
/// corner that it only clips.
inline bool SeesThrough(const Ray& ray, const RayTarget& target, double end) {
  double enter = 0, leave = end;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = target.low[axis] * ray.inverse[axis];
    const double b = target.high[axis] * ray.inverse[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
    if (enter >= leave) return false;
  }
  if (leave == end) return false;  // it ends inside the box
  if (target.solid) return true;
  constexpr int kSamples = 8;
  const Eigen::Vector3d step = 4 * (leave - enter) / kSamples * ray.along;
  Eigen::Vector3d at = 4 * (enter * ray.along - target.corner) + 0.5 * step;
  for (int i = 0; i < kSamples; ++i, at += step) {
    const int x = std::clamp(static_cast<int>(at.x()), 0, 3);
    const int y = std::clamp(static_cast<int>(at.y()), 0, 3);
    const int z = std::clamp(static_cast<int>(at.z()), 0, 3);
    if ((target.mask >> (x + 4 * y + 16 * z) & 1) != 0) return true;
  }
  return false;
}

}  // namespace mapkeep
