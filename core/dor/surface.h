#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

namespace mapkeep {

/// Moments of occupied sub-voxels, in quarters of a voxel's edge: integers, so that sums do not depend on their order.
struct Moments {
  int64_t count = 0;
  std::array<int64_t, 3> sum{};
  std::array<int64_t, 6> products{};  ///< xx, xy, xz, yy, yz, zz

  /// Moments about an origin that lies `by` sub-voxels lower an axis.
  Moments Shifted(const std::array<int64_t, 3>& by) const;
  Moments& operator+=(const Moments& other);
};

/// The moments of a 4x4x4 mask about the voxel's corner; sub-voxel centres count as 0..3.
Moments MomentsOf(uint64_t mask);

/// The shape of a set of sub-voxels, from the covariance of their centres.
struct Surface {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();     ///< direction of least variance
  Eigen::Vector3d variances = Eigen::Vector3d::Zero();  ///< lambda_1 >= lambda_2 >= lambda_3 >= 0, square sub-voxels
  /// Pi_v of eq. 6, (lambda_2 - lambda_3) / lambda_1; 0 for a point or a line.
  double planarity() const { return variances[0] > 0 ? (variances[1] - variances[2]) / variances[0] : 0; }
};

Surface SurfaceOf(const Moments& moments);

/// The mean of a mask's sub-voxel centres inside its voxel, in voxel edges: [0, 1) an axis; the middle for an empty
/// one.
Eigen::Vector3d MeanInVoxel(uint64_t mask);

}  // namespace mapkeep
