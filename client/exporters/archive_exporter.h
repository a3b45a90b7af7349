#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>

#include "client/exporters/map_exporter.h"

namespace mapkeep {

/// A map archive (client/archive): every field of every voxel that comes.
absl::StatusOr<std::unique_ptr<MapExporter>> OpenArchiveExporter(const std::filesystem::path& path,
                                                                 const ExportedMap& map);

}  // namespace mapkeep
