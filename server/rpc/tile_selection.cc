#include "server/rpc/tile_selection.h"

#include <absl/container/flat_hash_map.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/names.h"
#include "server/rpc/tile_message.h"

namespace mapkeep {
namespace {

constexpr int32_t kTileVoxels = kBlockSize << kTileBits;
constexpr int32_t kTileLimit = kVoxelLimit / kTileVoxels;
constexpr int32_t kBlockLimit = kVoxelLimit / kBlockSize;

absl::StatusOr<TileKey> KeyOf(const v1::TileId& id) {
  for (const int32_t c : {id.x(), id.y()}) {
    if (c < -kTileLimit || c >= kTileLimit) {
      return absl::InvalidArgumentError(absl::StrFormat("tile (%d, %d): expected numbers from %d to %d", id.x(), id.y(),
                                                        -kTileLimit, kTileLimit - 1));
    }
  }
  return TileKeyOf(VoxelIndex{id.x(), id.y(), 0});
}

int32_t BlockAt(double coordinate, double block_size) {
  return static_cast<int32_t>(std::clamp<double>(std::floor(coordinate / block_size), -kBlockLimit, kBlockLimit - 1));
}

absl::StatusOr<BlockRange> ColumnsOf(const v1::Box& area, double voxel_size) {
  const v1::Point& min = area.min();
  const v1::Point& max = area.max();
  // This way round, NaN is refused as well.
  if (!(min.x() < max.x() && min.y() < max.y())) {
    return absl::InvalidArgumentError("area: expected x and y of min below those of max");
  }
  const double size = voxel_size * kBlockSize;
  // What ends where a block begins does not touch it.
  const auto last = [size](double coordinate) {
    const double block = std::ceil(coordinate / size) - 1;
    return static_cast<int32_t>(std::clamp<double>(block, -kBlockLimit, kBlockLimit - 1));
  };
  return BlockRange{{BlockAt(min.x(), size), BlockAt(min.y(), size), 0}, {last(max.x()), last(max.y()), 0}};
}

absl::StatusOr<std::unique_ptr<Snapshot>> Open(const ServiceContext& context, const std::string& map,
                                               std::optional<uint64_t> epoch) {
  if (absl::Status status = CheckName("map name", map); !status.ok()) return status;
  return context.maps.Open(map, epoch);
}

}  // namespace

absl::StatusOr<TileSelection> SelectTiles(const ServiceContext& context, const std::string& map,
                                          std::optional<uint64_t> epoch, const v1::Box* area) {
  auto snapshot = Open(context, map, epoch);
  if (!snapshot.ok()) return snapshot.status();
  std::optional<BlockRange> range;
  if (area != nullptr) {
    const absl::StatusOr<BlockRange> columns = ColumnsOf(*area, (*snapshot)->map().voxel_size);
    if (!columns.ok()) return columns.status();
    range = *columns;
  }
  auto tiles = (*snapshot)->TileEntries(range);
  if (!tiles.ok()) return tiles.status();
  return TileSelection{*std::move(snapshot), *std::move(tiles)};
}

absl::StatusOr<TileSelection> SelectTiles(const ServiceContext& context, const std::string& map,
                                          std::optional<uint64_t> epoch,
                                          const google::protobuf::RepeatedPtrField<v1::TileId>& ids) {
  std::vector<TileKey> keys;
  for (const v1::TileId& id : ids) {
    const absl::StatusOr<TileKey> key = KeyOf(id);
    if (!key.ok()) return key.status();
    keys.push_back(*key);
  }
  std::ranges::sort(keys);
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  auto snapshot = Open(context, map, epoch);
  if (!snapshot.ok()) return snapshot.status();
  std::vector<TileEntry> tiles;
  for (const TileKey key : keys) {
    const absl::StatusOr<std::optional<TileEntry>> entry = (*snapshot)->FindTile(key);
    if (!entry.ok()) return entry.status();
    if (*entry) tiles.push_back(**entry);
  }
  return TileSelection{*std::move(snapshot), std::move(tiles)};
}

absl::StatusOr<TileChanges> ChangesFor(const google::protobuf::RepeatedPtrField<v1::TileVersion>& held,
                                       const std::vector<TileEntry>& selected) {
  absl::flat_hash_map<TileKey, const v1::TileVersion*> known;
  for (const v1::TileVersion& tile : held) {
    const absl::StatusOr<TileKey> key = KeyOf(tile.id());
    if (!key.ok()) return key.status();
    if (!known.emplace(*key, &tile).second) {
      return absl::InvalidArgumentError(absl::StrFormat("held: tile (%d, %d) twice", tile.id().x(), tile.id().y()));
    }
  }
  TileChanges changes;
  for (const TileEntry& entry : selected) {
    const auto found = known.find(entry.key);
    if (found == known.end()) {
      changes.changed.push_back(entry);
      continue;
    }
    if (found->second->version() != VersionOf(entry)) changes.changed.push_back(entry);
    known.erase(found);
  }
  for (const v1::TileVersion& tile : held) {
    if (known.contains(*KeyOf(tile.id()))) changes.dropped.push_back(tile.id());
  }
  return changes;
}

}  // namespace mapkeep
