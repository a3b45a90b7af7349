#pragma once

#include <absl/container/flat_hash_map.h>

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/registration/match_cloud.h"

namespace mapkeep {

/// Numbers for the voxels that points fall into, counted in the order in which they first occur.
class VoxelNumbers {
 public:
  /// `edge` metres.
  explicit VoxelNumbers(double edge) : edge_(edge) {}

  double edge() const { return edge_; }
  size_t size() const { return numbers_.size(); }
  void Reserve(size_t voxels) { numbers_.reserve(voxels); }

  /// That of the voxel of a point, a new one if it is the first there. Nothing for a point that is not finite, or 2^20
  /// voxels or more from the origin.
  std::optional<uint32_t> Take(const Eigen::Vector3d& point);
  /// That of the voxel of a point, if it has one.
  std::optional<uint32_t> Find(const Eigen::Vector3d& point) const;

 private:
  double edge_;
  absl::flat_hash_map<uint64_t, uint32_t> numbers_;
  uint64_t last_key_ = ~uint64_t{0};  // that no voxel has
  uint32_t last_ = 0;
};

/// One mean point a voxel of `edge` metres, in the order in which the voxels first occur. Points that have no voxel
/// number are left out.
std::vector<Eigen::Vector3d> ThinPoints(std::span<const Eigen::Vector3d> points, double edge);
/// The same; the point of each voxel is at its number. `numbers` has none yet.
std::vector<Eigen::Vector3d> ThinPoints(std::span<const Eigen::Vector3d> points, VoxelNumbers& numbers);

/// The same of points that face somewhere: the facings of a voxel are averaged as well.
FacingPoints ThinPoints(const FacingPoints& input, double edge);

}  // namespace mapkeep
