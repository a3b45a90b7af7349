#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "core/geometry/pose.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// VIEWPOINT of a PCD file (tx ty tz qw qx qy qz): where the sensor stood. Reads the header alone.
absl::StatusOr<Pose> ReadPcdViewpoint(const std::filesystem::path& file);

/// The points of a PCD file, ascii, binary or compressed, as they stand in the file; x, y, z and, if there is one,
/// intensity in any number type. An error for what is no such file, is truncated or holds too many points.
absl::StatusOr<Scan> ReadPcdPoints(const std::filesystem::path& file);

}  // namespace mapkeep
