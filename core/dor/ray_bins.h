#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/dor/sub_voxels.h"

namespace mapkeep {

/// The rays of one scan, sorted by direction, so that the few that may pass a small box are found without walking any.
/// Works for any sensor: bins of equal solid angle over the directions that occur, about a ray each. Lengths in any
/// unit, directions in axes that are the same for rays and queries.
class RayBins {
 public:
  /// From the vectors that lead from the sensor to the returns; of every ray the given share of its length counts. Uses
  /// the memory of the scan before again.
  void Build(std::span<const Eigen::Vector3d> to_ends, double share);

  /// A region that rays may pass: an upright cylinder around a point relative to the sensor.
  struct Region {
    Eigen::Vector3d centre;
    double radius = 0;       ///< level
    double half_height = 0;  ///< vertical
  };

  /// Whether any ray near the region is at least as long as the region is far: false means that no ray passes it.
  bool MayReach(const Region& region) const { return Reaches(WindowOf(region)); }

  /// Whether test(ray) holds for any ray that may pass the region. Offers every ray that does, and some that do not.
  template <typename Test>
  bool AnyRay(const Region& region, const Test& test) const {
    const Window window = WindowOf(region);
    if (!Reaches(window)) return false;
    // Most regions that are passed at all are passed by a ray through their middle.
    const size_t middle =
        static_cast<size_t>((window.v0 + window.v1) / 2) * bins_u_ + (((window.u0 + window.u1) >> 1) & (bins_u_ - 1));
    for (uint32_t i = starts_[middle]; i < starts_[middle + 1]; ++i) {
      if (test(rays_[i])) return true;
    }
    if (window.u1 - window.u0 < 2 * kCoarseBins) return AnyRayIn(window, test);
    // A wide window is gone through in cells of 4 x 4 bins, most of which do not reach.
    const Level& coarse = levels_[kCoarse];
    for (int v = window.v0 >> kCoarse; v <= window.v1 >> kCoarse; ++v) {
      for (int u = window.u0 >> kCoarse; u <= window.u1 >> kCoarse; ++u) {
        if (coarse.reach[static_cast<size_t>(v) * (coarse.u_mask + 1) + (u & coarse.u_mask)] < window.distance)
          continue;
        const Window cell{std::max(window.u0, u << kCoarse), std::min(window.u1, (u << kCoarse) + kCoarseBins - 1),
                          std::max(window.v0, v << kCoarse), std::min(window.v1, (v << kCoarse) + kCoarseBins - 1),
                          window.distance};
        if (AnyRayIn(cell, test)) return true;
      }
    }
    return false;
  }

 private:
  static constexpr int kCoarse = 2;
  static constexpr int kCoarseBins = 1 << kCoarse;

  struct Direction {
    float diamond = 0, sine = 0, length = 0;
  };

  // Bins of directions, both ends included; u may leave [0, bins_u_) and wraps. And the nearest distance to look for.
  struct Window {
    int u0 = 0, u1 = 0, v0 = 0, v1 = 0;
    float distance = 0;
  };

  // The longest ray of every cell of 2^level x 2^level bins.
  struct Level {
    int u_mask = 0;  // cells around minus one
    int v_count = 0;
    std::vector<float> reach;
  };

  template <typename Test>
  bool AnyRayIn(const Window& window, const Test& test) const {
    for (int v = window.v0; v <= window.v1; ++v) {
      const size_t row = static_cast<size_t>(v) * bins_u_;
      for (int u = window.u0; u <= window.u1; ++u) {
        const size_t bin = row + (u & (bins_u_ - 1));
        if (levels_[0].reach[bin] < window.distance) continue;
        for (uint32_t i = starts_[bin]; i < starts_[bin + 1]; ++i) {
          if (test(rays_[i])) return true;
        }
      }
    }
    return false;
  }

  Window WindowOf(const Region& region) const;
  bool Reaches(const Window& window) const;
  int BinV(double sine) const;

  int bins_u_ = 1, bins_v_ = 1;  // around (a power of two), and from the lowest direction to the highest
  double sine_low_ = 0, sine_high_ = 0, v_scale_ = 0, u_scale_ = 0;
  std::vector<Level> levels_;
  std::vector<uint32_t> starts_;
  std::vector<Ray> rays_;              // by bin
  std::vector<Direction> directions_;  // of the rays as they came
  std::vector<uint32_t> bin_of_;
};

}  // namespace mapkeep
