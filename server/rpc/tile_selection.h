#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mapkeep/v1/tile_service.pb.h"
#include "server/rpc/context.h"

namespace mapkeep {

/// What a call about tiles is about: one epoch of a map, and those of its tiles that were meant.
struct TileSelection {
  std::unique_ptr<Snapshot> snapshot;
  std::vector<TileEntry> tiles;  ///< in key order
};

/// The tiles that an area touches, seen from above (nullptr: all). Errors as of MapStore::Open; INVALID_ARGUMENT for a
/// bad name or area.
absl::StatusOr<TileSelection> SelectTiles(const ServiceContext& context, const std::string& map,
                                          std::optional<uint64_t> epoch, const v1::Box* area);

/// The tiles with these ids, those that the map has, each once. Also INVALID_ARGUMENT for an id out of range.
absl::StatusOr<TileSelection> SelectTiles(const ServiceContext& context, const std::string& map,
                                          std::optional<uint64_t> epoch,
                                          const google::protobuf::RepeatedPtrField<v1::TileId>& ids);

/// How the holder of tiles gets to a selection.
struct TileChanges {
  std::vector<TileEntry> changed;   ///< new, or held with another version
  std::vector<v1::TileId> dropped;  ///< held, and not selected
};

/// INVALID_ARGUMENT for a held tile that is out of range or named twice.
absl::StatusOr<TileChanges> ChangesFor(const google::protobuf::RepeatedPtrField<v1::TileVersion>& held,
                                       const std::vector<TileEntry>& selected);

}  // namespace mapkeep
