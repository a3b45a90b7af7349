#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Geometry>
#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapkeep {

/// A square of 128 x 128 voxel columns of a map; x from 128 * x * voxel_size metres, y likewise.
struct TileId {
  int32_t x = 0, y = 0;
  auto operator<=>(const TileId&) const = default;
};

/// What a tile tells of each voxel: a mean point with its normal, or also which quarters of its edge are occupied.
enum class TileDetail { kCentroids, kSubVoxels };

/// Which tiles.
struct TileQuery {
  std::string map;
  std::optional<uint64_t> epoch;            ///< nothing: the newest
  std::optional<Eigen::AlignedBox3d> area;  ///< touched seen from above, metres from the origin; nothing: everything
  TileDetail detail = TileDetail::kSubVoxels;
};

/// A tile without its content. Versions are opaque: another content has another one.
struct TileInfo {
  TileId id;
  std::string version;
  uint64_t bytes = 0;   ///< of the tile when it is sent, and as a file
  uint64_t voxels = 0;  ///< static ones
};

struct TileList {
  uint64_t epoch = 0;
  std::vector<TileInfo> tiles;
};

/// A tile as somebody has it.
struct HeldTile {
  TileId id;
  std::string version;
};

/// What a differential call brings.
struct TileChangesInfo {
  uint64_t epoch = 0;           ///< that the caller is at once everything is applied
  std::vector<TileId> dropped;  ///< held, and no longer wanted
  uint64_t changed_tiles = 0;   ///< that follow
  uint64_t changed_bytes = 0;   ///< of them
  uint64_t tiles = 0;           ///< of the area in all
};

/// A tile as it is sent and kept: `bytes` is a serialised mapkeep.v1.MapTile.
struct EncodedTile {
  TileId id;
  std::string version;
  std::string bytes;
};

/// A new epoch of a map that is watched.
struct MapEvent {
  uint64_t epoch = 0;
  std::string session;        ///< that made it; may be empty
  bool rollback = false;      ///< an earlier content came back
  std::vector<TileId> tiles;  ///< touched
  bool any_tile = false;      ///< any tile may have changed, `tiles` is empty
  std::string resume_token;   ///< goes on after this event
};

/// One static voxel.
struct TileVoxel {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();   ///< its mean point, metres from the map's origin
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< towards where the robots drove; zero: unknown
  float stability = 0;                               ///< R of eq. 4, [0, 1]
  float intensity = 0;                               ///< [0, 1]
  bool ground = false;
  uint64_t mask = 0;                                 ///< occupied 4x4x4 sub-voxels, bit x + 4 y + 16 z; 0: not told
  Eigen::Vector3d corner = Eigen::Vector3d::Zero();  ///< lowest corner of the voxel, metres from the map's origin
};

/// The static voxels of a tile.
struct MapTile {
  std::string map;
  TileId id;
  std::string version;
  double voxel_size = 0;                  ///< metres
  std::optional<Eigen::Vector3d> origin;  ///< of the map's coordinates, metres
  std::string crs;                        ///< "EPSG:N", or empty
  bool has_masks = false;
  std::vector<TileVoxel> voxels;
};

/// The tile behind the bytes of an EncodedTile or of a tile file. DATA_LOSS if they are damaged.
absl::StatusOr<MapTile> DecodeTile(std::string_view bytes);

/// Centres of the occupied sub-voxels (points 5 cm apart where voxels have 20 cm), or the mean point if the tile has no
/// masks. Metres from the map's origin.
std::vector<Eigen::Vector3d> PointsOf(const MapTile& tile, const TileVoxel& voxel);

}  // namespace mapkeep
