#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>

#include "client/exporters/map_exporter.h"

namespace mapkeep {

/// OctoMap's binary tree (.bt, `id OcTree`): occupied leaves of a quarter of a voxel's edge, or of a voxel's with
/// kCentroids; nothing is known to be free. A block is a whole subtree, because its edge is a power of two of leaves:
/// it is encoded when it comes and spooled to disk, and the tree above it is walked at the end, so that only 24 bytes a
/// block are held. OUT_OF_RANGE for what OctoMap cannot reach, 32,768 leaves from the origin an axis.
absl::StatusOr<std::unique_ptr<MapExporter>> OpenOctoMapFile(const std::filesystem::path& path, const ExportedMap& map,
                                                             const ExportOptions& options);

}  // namespace mapkeep
