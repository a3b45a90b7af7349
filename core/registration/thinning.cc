#include "core/registration/thinning.h"

#include <absl/container/flat_hash_map.h>

#include <cstdint>
#include <limits>

namespace mapkeep {
namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// For each point the number of its voxel, counted in the order in which voxels first occur; kNone for one left out.
std::vector<uint32_t> VoxelNumbers(std::span<const Eigen::Vector3d> points, double edge, size_t& voxels) {
  constexpr double kLimit = 1 << 20;
  absl::flat_hash_map<uint64_t, uint32_t> numbers;
  numbers.reserve(points.size() / 4);
  std::vector<uint32_t> result(points.size(), kNone);
  const double per_metre = 1 / edge;
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d cell = (points[i] * per_metre).array().floor();
    if (!(cell.cwiseAbs().maxCoeff() < kLimit) || !cell.allFinite()) continue;
    const auto bits = [](double c) { return static_cast<uint64_t>(static_cast<int64_t>(c + kLimit)); };
    const uint64_t key = bits(cell.x()) | bits(cell.y()) << 21 | bits(cell.z()) << 42;
    result[i] = numbers.try_emplace(key, static_cast<uint32_t>(numbers.size())).first->second;
  }
  voxels = numbers.size();
  return result;
}

std::vector<Eigen::Vector3d> MeansOf(std::span<const Eigen::Vector3d> values, std::span<const uint32_t> numbers,
                                     size_t voxels) {
  std::vector<Eigen::Vector3d> means(voxels, Eigen::Vector3d::Zero());
  std::vector<uint32_t> counts(voxels);
  for (size_t i = 0; i < values.size(); ++i) {
    if (numbers[i] == kNone) continue;
    means[numbers[i]] += values[i];
    ++counts[numbers[i]];
  }
  for (size_t i = 0; i < voxels; ++i) means[i] /= counts[i];
  return means;
}

}  // namespace

std::vector<Eigen::Vector3d> ThinPoints(std::span<const Eigen::Vector3d> points, double edge) {
  size_t voxels = 0;
  const std::vector<uint32_t> numbers = VoxelNumbers(points, edge, voxels);
  return MeansOf(points, numbers, voxels);
}

FacingPoints ThinPoints(const FacingPoints& input, double edge) {
  size_t voxels = 0;
  const std::vector<uint32_t> numbers = VoxelNumbers(input.points, edge, voxels);
  return {MeansOf(input.points, numbers, voxels), MeansOf(input.facing, numbers, voxels)};
}

}  // namespace mapkeep
