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

/// A ray from the sensor, lengths in voxel edges. Its points are from + t along, t in [0, 1]. Floats: at 100 m they are
/// off by a thousandth of a voxel's edge.
struct Ray {
  std::array<float, 3> along;
  std::array<float, 3> inverse;  ///< 1 / along; a huge number for 0, so that products stay defined

  explicit Ray(const std::array<float, 3>& to_end) : along(to_end) {
    for (int axis = 0; axis < 3; ++axis) inverse[axis] = InverseOf(along[axis]);
  }
  explicit Ray(const Eigen::Vector3d& to_end)
      : Ray(std::array{static_cast<float>(to_end.x()), static_cast<float>(to_end.y()),
                       static_cast<float>(to_end.z())}) {}

  static float InverseOf(float value) { return value == 0 ? 1e30F : 1 / value; }
};

/// A mask's box in 16 bits, made once a session: two bits each for the lowest and the highest sub-voxel an axis, and
/// whether no sub-voxel of the box is empty.
using BoxCode = uint16_t;

inline BoxCode CodeOf(uint64_t mask) {
  const MaskBox box = BoxOf(mask);
  int code = std::popcount(mask) == box.volume() ? 1 << 12 : 0;
  for (int axis = 0; axis < 3; ++axis) code |= box.low[axis] << (4 * axis) | (box.high[axis] - 1) << (4 * axis + 2);
  return static_cast<BoxCode>(code);
}

/// The occupied part of a voxel as a ray meets it. Lengths in voxel edges, relative to the sensor.
struct RayTarget {
  uint64_t mask;                   ///< occupied sub-voxels; kFullMask where the box has no empty one
  std::array<float, 3> corner;     ///< the voxel's lowest
  std::array<float, 3> low, high;  ///< the box around the occupied sub-voxels

  /// `cube` is the lowest corner of an aligned cube, relative to the sensor; the voxel is so many edges from there.
  /// Whoever asks about the same voxel must name the same cube, for the same bits.
  RayTarget(const std::array<float, 3>& cube, const std::array<int, 3>& voxel, uint64_t occupied, BoxCode box)
      : mask((box >> 12) != 0 ? kFullMask : occupied) {
    for (int axis = 0; axis < 3; ++axis) {
      corner[axis] = cube[axis] + static_cast<float>(voxel[axis]);
      low[axis] = corner[axis] + 0.25F * static_cast<float>(box >> (4 * axis) & 3);
      high[axis] = corner[axis] + 0.25F * static_cast<float>((box >> (4 * axis + 2) & 3) + 1);
    }
  }

  bool solid() const { return mask == kFullMask; }
};

/// Whether a ray that is inside the target's box between these times passes an occupied sub-voxel. The ray is sampled,
/// so that it may miss a corner that it only clips.
inline bool PassesMask(const std::array<float, 3>& along, float enter, float leave, const std::array<float, 3>& corner,
                       uint64_t mask) {
  constexpr int kSamples = 8;
  std::array<float, 3> at, step;
  for (int axis = 0; axis < 3; ++axis) {
    step[axis] = 4 * (leave - enter) / kSamples * along[axis];
    at[axis] = 4 * (enter * along[axis] - corner[axis]) + 0.5F * step[axis];
  }
  for (int i = 0; i < kSamples; ++i) {
    const int x = std::clamp(static_cast<int>(at[0]), 0, 3);
    const int y = std::clamp(static_cast<int>(at[1]), 0, 3);
    const int z = std::clamp(static_cast<int>(at[2]), 0, 3);
    if ((mask >> (x + 4 * y + 16 * z) & 1) != 0) return true;
    for (int axis = 0; axis < 3; ++axis) at[axis] += step[axis];
  }
  return false;
}

/// Whether a ray passes through the target before t = end, and not only as far as a place inside its box.
inline bool SeesThrough(const Ray& ray, const RayTarget& target, float end) {
  float enter = 0, leave = end;
  for (int axis = 0; axis < 3; ++axis) {
    const float a = target.low[axis] * ray.inverse[axis];
    const float b = target.high[axis] * ray.inverse[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  if (enter >= leave || leave == end) return false;
  return target.solid() || PassesMask(ray.along, enter, leave, target.corner, target.mask);
}

}  // namespace mapkeep
