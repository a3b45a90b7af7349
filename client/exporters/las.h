#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>

#include "client/exporters/map_exporter.h"

namespace mapkeep {

/// LAS 1.4, point data record format 6, coordinates with the map's origin added, in millimetres from its whole metres.
/// - The CRS is a WKT record, as the format asks of point formats 6 to 10; a map without one has none.
/// - Classification 2 (ground) or 1; intensity over the whole 16 bits; GPS time (adjusted standard) is the start of the
///   last session that saw the voxel; the extra byte `stability` is R scaled to 255.
/// OUT_OF_RANGE for a point that 32 bits of millimetres do not reach.
absl::StatusOr<std::unique_ptr<MapExporter>> OpenLas(const std::filesystem::path& path, const ExportedMap& map,
                                                     const ExportOptions& options);

}  // namespace mapkeep
