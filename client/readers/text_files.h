#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <optional>
#include <vector>

#include "core/geometry/pose.h"

namespace mapkeep {

/// A file of 3x4 rows: one pose a line, 12 numbers. Errors name file and line: a short or long row, what is not a
/// number, a pose that is not finite or no rotation. Empty lines at the end and lines that begin with # do not count.
absl::StatusOr<std::vector<Pose>> ReadPoses(const std::filesystem::path& file);

/// One time a line, seconds, finite and not negative. Empty if there is no such file.
absl::StatusOr<std::vector<double>> ReadTimes(const std::filesystem::path& file);

struct TimedPose {
  double time = 0;  ///< in the file's own unit
  Pose pose = Pose::Identity();
};

/// A pose a line, after its time: 13 numbers, a time and a 3x4 matrix row by row, or 8, a time, x y z and the
/// quaternion qx qy qz qw. Otherwise as ReadPoses.
absl::StatusOr<std::vector<TimedPose>> ReadTimedPoses(const std::filesystem::path& file);

/// The `Tr:` row of a KITTI calib.txt: camera 0 from LiDAR. Nothing if there is no such file or row.
absl::StatusOr<std::optional<Pose>> ReadCalibration(const std::filesystem::path& file);

}  // namespace mapkeep
