#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "client/readers/session_directory.h"

namespace mapkeep {

/// The layout of MulRan and HeLiPR: scans named by their time in nanoseconds, Ouster/*.bin (or LiDAR/Ouster/*.bin; also
/// Velodyne, Avia and Aeva), and poses at times of their own: global_pose.csv with rows of a time and a 3x4 matrix, or
/// HeLiPR's LiDAR_GT/Ouster_gt.txt with rows of a time, x y z and qx qy qz qw. Poses are interpolated at the scans'
/// times; scans before the first and after the last pose are left out. With a `Tr:` row in calib.txt (3x4, vehicle from
/// LiDAR) the poses are the vehicle's, else the LiDAR's.
///
/// A point is float32 x y z intensity (MulRan), or with HeLiPR's sensors 26 bytes (Ouster), 22 (Velodyne), 19 (Avia) or
/// 25 or 29 (Aeva), which also have the time of each point: told by which of them the file's size and content can be.
absl::StatusOr<SessionDirectory> OpenMulran(const std::filesystem::path& directory, const SessionOptions& options);

/// Whether the directory has such scans and poses.
bool IsMulran(const std::filesystem::path& directory);

}  // namespace mapkeep
