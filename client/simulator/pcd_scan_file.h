#pragma once

#include <absl/status/status.h>

#include <filesystem>

#include "client/simulator/session_files.h"
#include "core/geometry/pose.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// Writes x, y, z and intensity as float32 (in ascii: with 9 digits) to a PCD file, `viewpoint` in its header. The scan
/// must have intensities. An error naming the file if it cannot be written.
absl::Status WritePcdScan(const std::filesystem::path& file, const Scan& scan, const Pose& viewpoint,
                          PcdEncoding encoding);

}  // namespace mapkeep
