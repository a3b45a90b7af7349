#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <span>

#include "core/geometry/pose.h"

namespace mapkeep {

/// Writes poses as 3x4 rows, one a line, in as many digits as bring back the same numbers.
absl::Status WritePoses(const std::filesystem::path& path, std::span<const Pose> poses);

}  // namespace mapkeep
