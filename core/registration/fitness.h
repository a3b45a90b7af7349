#pragma once

#include <Eigen/Core>
#include <span>

#include "core/geometry/pose.h"
#include "core/registration/gicp.h"
#include "core/registration/point_tree.h"

namespace mapkeep {

/// How well a placed cloud lies on the target.
struct Fit {
  size_t inliers = 0;  ///< points within the inlier distance (tau_d) of a target point
  double fitness = 0;  ///< f_u: their share of all points
  /// How well the surfaces that were met fix the position along the weakest direction: the smallest eigenvalue of the
  /// mean of n n^T over the inliers' normals. 0: a plane or an empty corridor, along which anything fits; 1/3: equally
  /// well in all directions. 0 if no normals are known.
  double observability = 0;
};

/// The fit of `points` under `pose` (T_target_points) on the target whose tree is given. The same on any number of
/// threads.
Fit FitOf(std::span<const Eigen::Vector3d> points, const SurfaceCloud& target, const PointTree& tree, const Pose& pose,
          double inlier_distance);

}  // namespace mapkeep
