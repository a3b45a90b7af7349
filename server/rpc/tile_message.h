#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "mapkeep/v1/tile_service.pb.h"
#include "storage/map_store.h"

namespace mapkeep {

/// The version of a tile's content as the wire has it.
std::string VersionOf(const TileEntry& entry);

/// The tile as a message with its static voxels, each with its stability by `eta` (scans). Errors as of Snapshot::Read.
absl::StatusOr<v1::MapTile> MakeTile(const Snapshot& snapshot, const TileEntry& entry, v1::TileDetail detail,
                                     double eta);

/// The tile without its content. The size is that of MakeTile's message, which is not made for it: every column has so
/// many bytes a voxel.
v1::TileInfo DescribeTile(const Snapshot& snapshot, const TileEntry& entry, v1::TileDetail detail);

}  // namespace mapkeep
