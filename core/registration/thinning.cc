#include "core/registration/thinning.h"

#include <absl/container/flat_hash_map.h>

#include <cstdint>

namespace mapkeep {

std::vector<Eigen::Vector3d> ThinPoints(std::span<const Eigen::Vector3d> points, double edge) {
  constexpr double kLimit = 1 << 20;
  absl::flat_hash_map<uint64_t, uint32_t> slots;
  slots.reserve(points.size() / 4);
  std::vector<Eigen::Vector3d> sums;
  std::vector<uint32_t> counts;
  const double per_metre = 1 / edge;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d cell = (point * per_metre).array().floor();
    if (!(cell.cwiseAbs().maxCoeff() < kLimit) || !cell.allFinite()) continue;
    const auto bits = [](double c) { return static_cast<uint64_t>(static_cast<int64_t>(c + kLimit)); };
    const uint64_t key = bits(cell.x()) | bits(cell.y()) << 21 | bits(cell.z()) << 42;
    const auto [slot, added] = slots.try_emplace(key, static_cast<uint32_t>(sums.size()));
    if (added) {
      sums.push_back(point);
      counts.push_back(1);
    } else {
      sums[slot->second] += point;
      ++counts[slot->second];
    }
  }
  for (size_t i = 0; i < sums.size(); ++i) sums[i] /= counts[i];
  return sums;
}

}  // namespace mapkeep
