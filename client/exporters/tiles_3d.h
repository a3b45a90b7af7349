#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>

#include "client/exporters/map_exporter.h"

namespace mapkeep {

/// OGC 3D Tiles 1.1 as a directory: tileset.json and tiles/*.glb, as the daemon serves them (core/tiling).
absl::StatusOr<std::unique_ptr<MapExporter>> OpenTiles3d(const std::filesystem::path& path, const ExportedMap& map,
                                                         const ExportOptions& options);

}  // namespace mapkeep
