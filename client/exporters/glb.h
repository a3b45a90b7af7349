#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>

#include "client/exporters/map_exporter.h"

namespace mapkeep {

/// One binary glTF 2.0 file: a mesh of points for every 65,536 or so of them, as core/tiling encodes one, all in one
/// scene, y up. Points wait on disk; what is held is the description, about 2 kB a mesh. OUT_OF_RANGE beyond the 4 GiB
/// that the format can count, about 130 million points.
absl::StatusOr<std::unique_ptr<MapExporter>> OpenGlb(const std::filesystem::path& path, const ExportedMap& map,
                                                     const ExportOptions& options);

}  // namespace mapkeep
