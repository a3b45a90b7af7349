#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "client/mapkeep/client.h"
#include "client/mapkeep/map_tiles.h"

namespace mapkeep {

// A folder that holds a map's tiles as of one epoch, one file a tile, whatever happens to the process that keeps it:
//
//   DIR/manifest.json   which map, epoch and tiles; replaced in one step, when every file that it names is there
//   DIR/tiles/X_Y.VERSION.tile   a serialised mapkeep.v1.MapTile (DecodeTile); never changed once it has its name
//   DIR/lock            held by the process that keeps the folder
//
// A reader takes the files that the manifest names. Others are on their way in, or out: if one that it names is gone,
// read the manifest again.

/// A tile file in the folder.
struct TileFile {
  TileId id;
  std::string version;
  std::filesystem::path path;
  uint64_t bytes = 0;
};

/// What the manifest says.
struct TileManifest {
  std::string map;
  TileDetail detail = TileDetail::kSubVoxels;
  uint64_t epoch = 0;
  std::vector<TileFile> tiles;  ///< by id
};

/// NOT_FOUND if the folder has none, FAILED_PRECONDITION if it is not one of these.
absl::StatusOr<TileManifest> ReadTileManifest(const std::filesystem::path& folder);

/// How far a synchronisation is.
struct TileSyncProgress {
  uint64_t tiles = 0, of_tiles = 0;  ///< received, of those that are to come
  uint64_t bytes = 0, of_bytes = 0;
};

/// What a synchronisation did.
struct TileSyncResult {
  uint64_t epoch = 0;
  uint64_t tiles = 0, bytes = 0;              ///< in the folder now
  uint64_t received = 0, received_bytes = 0;  ///< that had not been there
  uint64_t dropped = 0;                       ///< that are not in the map's area any more
};

/// Brings the folder (made if need be) to what the query asks for. Stopped, even killed, at any moment, it leaves the
/// folder at the epoch before, and what was received is not sent again. Outlasts breaks of the connection as long as
/// the client's patience, once the server has answered. FAILED_PRECONDITION if the folder holds another map's tiles,
/// ABORTED if another process keeps it.
absl::StatusOr<TileSyncResult> SyncTileFolder(const Client& client, const TileQuery& query,
                                              const std::filesystem::path& folder,
                                              const std::function<void(const TileSyncProgress&)>& progress = {});

}  // namespace mapkeep
