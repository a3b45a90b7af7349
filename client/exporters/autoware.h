#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>

#include "client/exporters/map_exporter.h"

namespace mapkeep {

/// Autoware's divided point cloud map, a directory as its map loader takes it: `pointcloud_map.pcd/X_Y.pcd`, one a cell
/// of 20 m from the whole metres (X, Y), float32 x y z intensity; `pointcloud_map_metadata.yaml` with the size of the
/// cells and each one's corner; `map_projector_info.yaml`, which says that coordinates are local. A cell is given a
/// file when points fall into it; points are held until 32 MiB of them wait.
absl::StatusOr<std::unique_ptr<MapExporter>> OpenAutoware(const std::filesystem::path& path, const ExportedMap& map,
                                                          const ExportOptions& options);

}  // namespace mapkeep
