#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace mapkeep {

inline constexpr int32_t kNoise = -1;  ///< the cluster id of a point that belongs to none

/// The clusters of a set of points.
struct Clusters {
  std::vector<int32_t> ids;  ///< one a point: 0..count-1, or kNoise
  int32_t count = 0;
};

/// DBSCAN (Ester et al., 1996) with search radius `epsilon` in metres (epsilon of section 3.3) and minimum
/// neighbourhood size `min_neighbours` (N_min; a point counts itself). A border point joins the cluster of its nearest
/// core point, ties going to the lower index, so that membership does not depend on the order of the points; clusters
/// are numbered by their first core point. Points must be finite. Cost is linear in the points for a bounded density.
Clusters ClusterPoints(std::span<const Eigen::Vector3d> points, double epsilon, int min_neighbours);

}  // namespace mapkeep
