#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "client/readers/session_directory.h"

namespace mapkeep {

/// The layout of KITTI odometry: velodyne/*.bin with float32 x y z intensity; poses.txt, 3x4 rows of LiDAR poses, or of
/// camera-0 poses if calib.txt has a `Tr` row (camera from LiDAR), then T_lidar = Tr^-1 T Tr; optional times.txt.
absl::StatusOr<SessionDirectory> OpenKitti(const std::filesystem::path& directory);

}  // namespace mapkeep
