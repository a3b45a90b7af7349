#pragma once

#include <absl/container/flat_hash_map.h>
#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "core/tiling/tile_tree.h"
#include "server/tiles/content_id.h"
#include "storage/byte_cache.h"
#include "storage/map_store.h"

namespace mapkeep {

/// The levels of detail of one epoch of one map, with the identity of every tile. Plain values: it holds no epoch.
struct EpochTiles {
  std::string map;
  uint64_t incarnation = 0, epoch = 0;
  double voxel_size = 0;
  std::optional<Eigen::Vector3d> origin;
  std::string crs;
  uint16_t newest_day = 0;  ///< that ages count back from: of the newest voxel that the epoch's commit touched
  std::vector<TileColumn> columns;
  std::vector<TileNode> tree;
  std::vector<ContentId> nodes;  ///< of the points below a node; what has the same id has the same points
  std::vector<ContentId> tiles;  ///< of the node's tile as it is sent
  ContentId all;                 ///< of the whole tileset
  absl::flat_hash_map<uint64_t, size_t> by_place;

  static uint64_t PlaceOf(const TileNodeId& id) { return static_cast<uint64_t>(id.level) << 32 | id.prefix; }
  /// The node's index, or nothing.
  std::optional<size_t> Find(const TileNodeId& id) const;
  size_t bytes() const;
};

/// Reads levels of detail from the tree of an epoch: no block but those that the epoch's commit touched. What it learnt
/// about a stored tile it remembers, so that the next epoch costs what changed. Thread-safe.
class EpochTilesReader {
 public:
  EpochTilesReader(const MapStore& maps, size_t memory_bytes) : maps_(maps), summaries_(memory_bytes) {}

  absl::StatusOr<std::shared_ptr<const EpochTiles>> Read(const Snapshot& snapshot);

 private:
  struct Summary {
    std::vector<TileColumn> columns;
    std::vector<ContentId> ids;  // of a column's blocks
  };
  using Name = std::tuple<uint64_t, TileKey, uint64_t, uint32_t>;  // incarnation, tile, version

  absl::StatusOr<std::shared_ptr<const Summary>> SummaryOf(const Snapshot& snapshot, const TileEntry& tile);
  absl::StatusOr<uint16_t> NewestDay(const Snapshot& snapshot) const;

  const MapStore& maps_;
  ByteCache<Name, Summary> summaries_;
};

}  // namespace mapkeep
