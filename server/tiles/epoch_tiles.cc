#include "server/tiles/epoch_tiles.h"

#include <algorithm>
#include <utility>

namespace mapkeep {
namespace {

constexpr uint64_t kTileFormat = 1;  // rises when the bytes of tiles change with the program
constexpr uint32_t kMinutesADay = 24 * 60;
constexpr int kMostRollbacks = 1000;

ContentId ColumnsId(const EpochTiles& tiles, const TileNode& node, const std::vector<ContentId>& column_ids) {
  ContentIdMaker maker;
  maker.Add(tiles.incarnation).Add(node.id.level);
  for (size_t i = node.first_column; i < node.first_column + node.columns; ++i) {
    maker.Add(tiles.columns[i].key).Add(column_ids[i]);
  }
  return maker.id();
}

// Parents come before their children, so from the end every child has its id.
void IdentifyNodes(EpochTiles& tiles, const std::vector<ContentId>& column_ids) {
  tiles.nodes.resize(tiles.tree.size());
  tiles.tiles.resize(tiles.tree.size());
  for (size_t i = tiles.tree.size(); i-- > 0;) {
    const TileNode& node = tiles.tree[i];
    if (node.children.empty()) {
      tiles.nodes[i] = ColumnsId(tiles, node, column_ids);
    } else {
      ContentIdMaker maker;
      maker.Add(tiles.incarnation).Add(node.id.level);
      for (const size_t child : node.children) maker.Add(tiles.nodes[child]);
      tiles.nodes[i] = maker.id();
    }
    const uint64_t parent_level = node.parent ? static_cast<uint64_t>(tiles.tree[*node.parent].id.level) : UINT64_MAX;
    tiles.tiles[i] = ContentIdMaker().Add(kTileFormat).Add(tiles.nodes[i]).Add(parent_level).Add(tiles.newest_day).id();
    tiles.by_place.emplace(EpochTiles::PlaceOf(node.id), i);
  }
  ContentIdMaker all;
  all.Add(kTileFormat).Add(tiles.incarnation).Add(tiles.epoch);
  tiles.all = all.id();
}

}  // namespace

std::optional<size_t> EpochTiles::Find(const TileNodeId& id) const {
  const auto found = by_place.find(PlaceOf(id));
  return found == by_place.end() ? std::nullopt : std::optional(found->second);
}

size_t EpochTiles::bytes() const {
  return sizeof(*this) + columns.size() * sizeof(TileColumn) +
         tree.size() * (sizeof(TileNode) + 2 * sizeof(ContentId) + 4 * sizeof(size_t) + 32);
}

absl::StatusOr<std::shared_ptr<const EpochTilesReader::Summary>> EpochTilesReader::SummaryOf(const Snapshot& snapshot,
                                                                                             const TileEntry& tile) {
  const Name name{snapshot.map().incarnation, tile.key, tile.version.attempt, tile.version.round};
  if (auto known = summaries_.Find(name)) return known;
  const auto blocks = snapshot.BlockEntries(tile.key);
  if (!blocks.ok()) return blocks.status();
  auto summary = std::make_shared<Summary>();
  std::vector<ContentIdMaker> makers;
  for (const BlockEntry& block : *blocks) {
    if (block.static_voxels == 0) continue;
    const uint32_t key = ColumnOf(block.key);
    const int32_t z = BlockIndexOf(block.key).z;
    if (summary->columns.empty() || summary->columns.back().key != key) {
      summary->columns.push_back({key, 0, z, z});
      makers.emplace_back();
    }
    TileColumn& column = summary->columns.back();
    column.voxels += block.static_voxels;
    column.highest = z;
    makers.back().Add(static_cast<uint64_t>(block.key)).Add(block.version.attempt).Add(block.version.round);
  }
  for (const ContentIdMaker& maker : makers) summary->ids.push_back(maker.id());
  const size_t bytes = sizeof(Summary) + summary->columns.size() * (sizeof(TileColumn) + sizeof(ContentId));
  summaries_.Insert(name, summary, bytes);
  return summary;
}

// Sessions may come late, so an epoch's newest voxel is looked for among those that its commit wrote. A rollback counts
// as the epoch that it brought back.
absl::StatusOr<uint16_t> EpochTilesReader::NewestDay(const Snapshot& snapshot) const {
  uint64_t epoch = snapshot.epoch();
  for (int i = 0; i < kMostRollbacks; ++i) {
    const auto versions = maps_.Versions(snapshot.map().name, epoch, 1);
    if (!versions.ok()) return versions.status();
    if (versions->empty() || versions->front().commit.epoch != epoch) return 0;
    const CommitRecord& commit = versions->front().commit;
    if (commit.rollback) {
      epoch = commit.base_epoch;
      continue;
    }
    uint32_t newest = 0;
    for (const TileKey tile : commit.touched_tiles) {
      const auto blocks = snapshot.ReadTile(tile);
      if (!blocks.ok()) return blocks.status();
      for (const auto& block : *blocks) {
        for (const Voxel& voxel : block->voxels) newest = std::max(newest, voxel.last_seen);
      }
    }
    return static_cast<uint16_t>(std::min<uint32_t>(newest / kMinutesADay, UINT16_MAX));
  }
  return 0;
}

absl::StatusOr<std::shared_ptr<const EpochTiles>> EpochTilesReader::Read(const Snapshot& snapshot) {
  auto tiles = std::make_shared<EpochTiles>();
  const MapRecord& map = snapshot.map();
  tiles->map = map.name;
  tiles->incarnation = map.incarnation;
  tiles->epoch = snapshot.epoch();
  tiles->voxel_size = map.voxel_size;
  tiles->origin = map.origin;
  tiles->crs = map.crs;
  const auto stored = snapshot.TileEntries({});
  if (!stored.ok()) return stored.status();
  std::vector<ContentId> column_ids;
  for (const TileEntry& tile : *stored) {
    const auto summary = SummaryOf(snapshot, tile);
    if (!summary.ok()) return summary.status();
    tiles->columns.insert(tiles->columns.end(), (*summary)->columns.begin(), (*summary)->columns.end());
    column_ids.insert(column_ids.end(), (*summary)->ids.begin(), (*summary)->ids.end());
  }
  const auto newest = NewestDay(snapshot);
  if (!newest.ok()) return newest.status();
  tiles->newest_day = *newest;
  tiles->tree = BuildTileTree(tiles->columns);
  IdentifyNodes(*tiles, column_ids);
  return tiles;
}

}  // namespace mapkeep
