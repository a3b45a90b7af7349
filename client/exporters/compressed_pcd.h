#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/exporters/map_exporter.h"

namespace mapkeep {

/// PCD 0.7, `DATA binary_compressed`: x y z intensity, column after column, as one LZF stream. The columns are spooled
/// to disk and compressed piece by piece: LZF knows no frames, so that pieces set end to end are one stream.
/// OUT_OF_RANGE beyond the 4 GiB that the format can count.
absl::StatusOr<std::unique_ptr<MapExporter>> OpenCompressedPcd(const std::filesystem::path& path,
                                                               const ExportedMap& map, const ExportOptions& options,
                                                               const std::vector<std::string>& comments);

}  // namespace mapkeep
