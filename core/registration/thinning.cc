#include "core/registration/thinning.h"

#include <limits>

namespace mapkeep {
namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

std::optional<uint64_t> KeyOf(const Eigen::Vector3d& point, double edge) {
  constexpr double kLimit = 1 << 20;
  const Eigen::Vector3d cell = (point / edge).array().floor();
  if (!(cell.cwiseAbs().maxCoeff() < kLimit) || !cell.allFinite()) return {};
  const auto bits = [](double c) { return static_cast<uint64_t>(static_cast<int64_t>(c + kLimit)); };
  return bits(cell.x()) | bits(cell.y()) << 21 | bits(cell.z()) << 42;
}

// For each point the number of its voxel; kNone for one left out.
std::vector<uint32_t> NumbersOf(std::span<const Eigen::Vector3d> points, VoxelNumbers& numbers) {
  numbers.Reserve(points.size() / 4);
  std::vector<uint32_t> result;
  result.reserve(points.size());
  for (const Eigen::Vector3d& point : points) result.push_back(numbers.Take(point).value_or(kNone));
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

std::optional<uint32_t> VoxelNumbers::Take(const Eigen::Vector3d& point) {
  const auto key = KeyOf(point, edge_);
  if (!key) return {};
  // Neighbours in a scan mostly share a voxel.
  if (*key != last_key_) {
    last_key_ = *key;
    last_ = numbers_.try_emplace(*key, static_cast<uint32_t>(numbers_.size())).first->second;
  }
  return last_;
}

std::optional<uint32_t> VoxelNumbers::Find(const Eigen::Vector3d& point) const {
  const auto key = KeyOf(point, edge_);
  if (!key) return {};
  const auto found = numbers_.find(*key);
  return found == numbers_.end() ? std::nullopt : std::optional(found->second);
}

std::vector<Eigen::Vector3d> ThinPoints(std::span<const Eigen::Vector3d> points, double edge) {
  VoxelNumbers numbers(edge);
  return ThinPoints(points, numbers);
}

std::vector<Eigen::Vector3d> ThinPoints(std::span<const Eigen::Vector3d> points, VoxelNumbers& numbers) {
  const std::vector<uint32_t> of = NumbersOf(points, numbers);
  return MeansOf(points, of, numbers.size());
}

FacingPoints ThinPoints(const FacingPoints& input, double edge) {
  VoxelNumbers numbers(edge);
  const std::vector<uint32_t> of = NumbersOf(input.points, numbers);
  return {MeansOf(input.points, of, numbers.size()), MeansOf(input.facing, of, numbers.size())};
}

}  // namespace mapkeep
