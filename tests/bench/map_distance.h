#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>

namespace mapkeep {

/// How close two static maps lie, by nearest neighbours: only points with one within 0.5 m count, as in the paper.
struct MapDistance {
  size_t inliers = 0;  ///< points of the second map that count
  double share = 0;    ///< of all of them
  double rmse = 0;     ///< metres, from the second map's points to the first's
  double chamfer = 0;  ///< metres: the mean of the mean distances both ways
};

/// Of `second` to `first`, both in one frame. Parallel on the calling oneTBB arena.
MapDistance DistanceBetween(std::span<const Eigen::Vector3d> first, std::span<const Eigen::Vector3d> second);

}  // namespace mapkeep
