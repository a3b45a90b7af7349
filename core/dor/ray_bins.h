#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/dor/sub_voxels.h"

namespace mapkeep {

/// Many targets of rays, eight to a group and a lane each, as RayBins asks for them.
class RayTargets {
 public:
  static constexpr size_t kLanes = 8;
  struct Group {
    alignas(32) float low[3][kLanes];
    alignas(32) float high[3][kLanes];
    alignas(32) float corner[3][kLanes];
    uint64_t masks[kLanes];
    bool sparse[kLanes];
  };

  size_t size() const { return size_; }
  /// The lanes behind the last target are those of earlier targets, or zero.
  const std::vector<Group>& groups() const { return groups_; }

  void Clear() { size_ = 0; }
  /// `sparse`: the rays may well miss what of the voxel is occupied, so whether any passes the voxel itself counts,
  /// too.
  void Add(const RayTarget& target, bool sparse = false) {
    const size_t lane = size_ % kLanes;
    if (size_ / kLanes == groups_.size()) groups_.emplace_back();
    Group& group = groups_[size_++ / kLanes];
    for (int axis = 0; axis < 3; ++axis) {
      group.low[axis][lane] = target.low[axis];
      group.high[axis][lane] = target.high[axis];
      group.corner[axis][lane] = target.corner[axis];
    }
    group.masks[lane] = target.mask;
    group.sparse[lane] = sparse;
  }

 private:
  std::vector<Group> groups_;
  size_t size_ = 0;
};

/// The rays of one scan, sorted by direction, so that the few that may pass a small box are found without walking any.
/// Works for any sensor: bins of equal solid angle over the directions that occur, about two rays each. Lengths in any
/// unit, directions in axes that are the same for rays and queries.
class RayBins {
 public:
  /// From the vectors that lead from the sensor to the returns, a column an axis; of every ray the given share of its
  /// length counts. Uses the memory of the scan before again.
  void Build(const std::array<std::vector<float>, 3>& to_ends, float share);

  /// A region that rays may pass: an upright cylinder around a point relative to the sensor.
  struct Region {
    std::array<float, 3> centre{};
    float radius = 0;       ///< level
    float half_height = 0;  ///< vertical
  };

  /// Whether any ray near the region is at least as long as the region is far: false means that no ray passes it.
  bool MayReach(const Region& region) const;

  /// How to tell whether the surroundings of a voxel are clear. Lengths in the unit of the rays, which is the voxel's
  /// edge.
  struct Clearance {
    float around = 0;  ///< to every side of the voxel; 0: nobody asks
    float behind = 0;  ///< how much farther than the voxel every ray must lead
  };

  static constexpr uint8_t kSeenThrough = 1;  ///< a ray passes the target: what SeesThrough says of any ray
  static constexpr uint8_t kConfirmed = 2;    ///< and all rays about the voxel lead far behind it
  static constexpr uint8_t kClear =
      4;  ///< likewise, by two rows of them, if a ray passes the target or, if it is sparse, its voxel

  /// What the rays say about each target, as bits.
  void Look(const RayTargets& targets, const Clearance& clearance, std::vector<uint8_t>& seen) const;

 private:
  // How directions become bins.
  struct Layout {
    int bins_u = 1, bins_v = 1;  // around (a power of two), and from the lowest direction to the highest
    float sine_low = 0, sine_high = 0, u_scale = 0, v_scale = 0;
  };

  // The longest and the shortest ray of every cell of 2^level x 2^level bins.
  struct Level {
    int u_mask = 0;  // cells around minus one
    int v_count = 0;
    std::vector<float> reach;     // what counts of the longest; 0 without rays
    std::vector<float> shortest;  // infinite without rays
  };

  struct Kernels;
  friend struct Kernels;

  float share_ = 1;
  Layout layout_;
  std::vector<Level> levels_;
  std::vector<uint32_t> starts_;
  std::array<std::vector<float>, 3> along_, inverse_;  // of the rays by bin, some harmless ones behind the last

  // Scratch.
  std::vector<float> diamond_, sine_, length_;  // of the rays as they came
  std::vector<uint32_t> bin_of_;
};

}  // namespace mapkeep
