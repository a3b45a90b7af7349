#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "client/readers/session_directory.h"

namespace mapkeep {

/// The layout of the KTH dynamic-map benchmark: pcd/*.pcd with points in the world frame and the sensor's pose in
/// VIEWPOINT; optional times.txt. Points are taken back to the sensor frame.
absl::StatusOr<SessionDirectory> OpenKth(const std::filesystem::path& directory);

}  // namespace mapkeep
