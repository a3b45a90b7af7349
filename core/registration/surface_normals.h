#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/registration/point_tree.h"

namespace mapkeep {

/// The plane through the neighbours of a point.
struct SurfaceNormal {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit, either sign; zero where the neighbours make no plane
  double roughness = 1;  ///< smallest over middle eigenvalue of the neighbours' covariance: 0 is a plane, 1 is a ball
};

/// The surface at each of `at`, from its nearest neighbours among `points`, whose tree is given. Parallel on the
/// calling oneTBB arena, with the same result on any number of threads.
std::vector<SurfaceNormal> SurfaceNormalsAt(std::span<const Eigen::Vector3d> at,
                                            std::span<const Eigen::Vector3d> points, const PointTree& tree);

}  // namespace mapkeep
