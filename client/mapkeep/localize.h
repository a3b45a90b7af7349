#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/mapkeep/session_info.h"
#include "core/geometry/pose.h"
#include "core/geometry/scan.h"
#include "core/scan_payload/scan_payload.h"

namespace mapkeep {

/// A few consecutive scans whose place in a map is asked for.
struct LocalizeQuestion {
  std::string map;
  ScanSource scans;         ///< at most 64
  std::vector<Pose> poses;  ///< T_odometry_sensor, one a scan
  std::optional<KnownStart> start;
  ScanEncoding encoding = ScanEncoding::kRaw;
};

/// Where the last scan was taken, or why that cannot be told.
struct LocalizeAnswer {
  bool found = false;
  std::string reason;
  Pose pose = Pose::Identity();  ///< T_map_sensor
  double fitness = 0;
  uint64_t inliers = 0;
  Eigen::Matrix<double, 6, 6> covariance =
      Eigen::Matrix<double, 6, 6>::Zero();  ///< of position (metres) and rotation (radians), map axes
  uint64_t epoch = 0;
};

}  // namespace mapkeep
