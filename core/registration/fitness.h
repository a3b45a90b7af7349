#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/geometry/pose.h"
#include "core/registration/gicp.h"
#include "core/registration/point_tree.h"

namespace mapkeep {

/// How well a placed cloud lies on the target.
struct Fit {
  size_t inliers = 0;  ///< points within the inlier distance (tau_d) of a target point
  /// f_u: their share of the points where the target knows anything (Coverage). Where it knows nothing, beyond the
  /// map's edge or above what its sensors saw, a point says nothing for or against.
  double fitness = 0;
  /// How well the surfaces that were met fix the position along the weakest direction: the smallest eigenvalue of the
  /// mean of n n^T over the inliers' normals. 0: a plane or an empty corridor, along which anything fits; 1/3: equally
  /// well in all directions. 0 if no normals are known.
  double observability = 0;
  /// Share of the inliers that lie on a surface of the target, within kSurfaceDistance of its plane. Tells right from
  /// nearly right, where fitness does not.
  double precision = 0;
  double surface_share = 0;  ///< share of all points that lie on a surface: compares places of one window
  double coverage = 0;       ///< share of all points where the target knows anything
};

inline constexpr double kSurfaceDistance = 0.1;  ///< metres

/// Where a target has anything at all: a coarse grid.
class Coverage {
 public:
  explicit Coverage(std::span<const Eigen::Vector3d> target);
  bool Holds(const Eigen::Vector3d& point) const;

 private:
  std::vector<uint64_t> cells_;  // ascending
};

/// The fit of `points` under `pose` (T_target_points) on the target whose tree and coverage are given. The same on any
/// number of threads.
Fit FitOf(std::span<const Eigen::Vector3d> points, const SurfaceCloud& target, const PointTree& tree,
          const Coverage& coverage, const Pose& pose, double inlier_distance);

}  // namespace mapkeep
