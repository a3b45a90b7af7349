#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>

#include "core/geometry/pose.h"
#include "core/geometry/scan.h"
#include "core/registration/parameters.h"
#include "core/registration/target_map.h"

namespace mapkeep {

/// Where a few scans were taken.
struct Localisation {
  bool found = false;
  std::string reason;            ///< why not; empty if found
  Pose pose = Pose::Identity();  ///< T_map_sensor of the last scan
  double fitness = 0;            ///< f_u of all scans together
  double precision = 0;          ///< share of the inliers on a surface of the map
  size_t inliers = 0;
  /// Of the position (metres) and the rotation (radians, about the position), map axes: what GICP's normal equations
  /// leave open, for pairs 5 cm off their surfaces of which a hundred err together.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// Places a few consecutive scans with odometry poses as AlignSession does a session, and says how well the last one is
/// known. Not found is a result, with its reason. Errors of the source and of the map are passed on.
absl::StatusOr<Localisation> Localise(const ScanSource& scans, std::span<const Pose> poses, const TargetMap& map,
                                      const std::optional<Pose>& prior, const AlignParameters& parameters);

}  // namespace mapkeep
