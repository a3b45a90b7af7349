#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "core/geometry/scan.h"

namespace mapkeep {

/// The points of a PCD file, ascii, binary or compressed, as they stand in the file; x, y, z and, if there is one,
/// intensity in any number type. Errors as ReadPcdHeader, and INVALID_ARGUMENT for
/// points that are damaged or fewer than announced.
absl::StatusOr<Scan> ReadPcdPoints(const std::filesystem::path& file);

}  // namespace mapkeep
