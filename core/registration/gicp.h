#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/geometry/pose.h"
#include "core/registration/point_tree.h"

namespace mapkeep {

/// Points with the normals of their surfaces: unit (either sign), or zero where unknown. Columns of equal length.
struct SurfaceCloud {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> normals;
};

/// One round of generalised ICP.
struct GicpParameters {
  double max_correspondence = 1.0;      ///< metres: pairs further apart do not count
  double robust_width = 0.2;            ///< metres along the normal at which a pair counts half (Cauchy weight)
  int max_iterations = 30;              ///<
  double translation_tolerance = 1e-3;  ///< metres: a smaller step ends the round,
  double rotation_tolerance = 1e-4;     ///< radians, if this holds as well
};

/// Where a round ended.
struct GicpResult {
  Pose pose = Pose::Identity();  ///< T_target_source
  size_t pairs = 0;              ///< correspondences of the last iteration
  bool converged = false;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of the source, target frame
  /// What the surfaces fix of the motion (translation, rotation about the centre): its covariance is the inverse, if
  /// every pair were off its surface by 1 m.
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
};

/// Generalised ICP (Segal, Haehnel and Thrun, 2009): each point is a flat disc on its surface, and the pose makes the
/// discs of nearest neighbours agree, by Gauss-Newton with robust weights. `tree` is that of target.points. What the
/// geometry does not fix stays as in `guess`. Parallel on the calling oneTBB arena; sums are taken in a fixed order, so
/// the result is the same on any number of threads.
GicpResult RefineByGicp(const SurfaceCloud& source, const SurfaceCloud& target, const PointTree& tree,
                        const Pose& guess, const GicpParameters& parameters);

}  // namespace mapkeep
