#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "client/readers/session_directory.h"

namespace mapkeep {

/// The layout of ELite and LT-mapper: Scans/*.pcd in the sensor frame and poses.txt, 3x4 rows of LiDAR poses; optional
/// times.txt.
absl::StatusOr<SessionDirectory> OpenElite(const std::filesystem::path& directory);

}  // namespace mapkeep
