
#include <algorithm>

#include "storage/map_store_state.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr int kTries = 16;

/// A value that is missing because this process slept past its pin is not damage.
absl::Status Explain(const Snapshot::State& state, const absl::Status& status) {
  if (!absl::IsDataLoss(status) || state.hold->Stands()) return status;
  return absl::FailedPreconditionError(
      Text("epoch ", state.at.epoch, " was collected while it was read: its pin had expired"));
}

absl::StatusOr<StoredRow<EpochState>> ReadEpoch(const Engine& engine, uint64_t incarnation, std::string_view map,
                                                std::optional<uint64_t> epoch) {
  const std::string partition = HeadPartition(incarnation);
  auto head = ReadRow(engine, partition, kHeadRow, DecodeEpoch);
  if (!head.ok()) return head.status();
  if (!*head) return absl::NotFoundError(Text("map ", map, " is being deleted"));
  const uint64_t newest = (*head)->value.epoch;
  if (!epoch || *epoch == newest) return **std::move(head);
  if (*epoch > newest) {
    return absl::NotFoundError(Text("map ", map, " has no epoch ", *epoch, ": its newest is ", newest));
  }
  const auto oldest = ReadRow(engine, partition, kOldestRow, DecodeNumber);
  if (!oldest.ok()) return oldest.status();
  if (*oldest && *epoch < (*oldest)->value) {
    const auto tags = ReadRow(engine, partition, kTagsRow, DecodeTags);
    if (!tags.ok()) return tags.status();
    if (*tags && IsTagged((*tags)->value, *epoch)) {
      auto root = ReadRow(engine, partition, RootRow(*epoch), DecodeEpoch);
      if (!root.ok()) return root.status();
      if (*root) return **std::move(root);
    }
    return absl::FailedPreconditionError(
        Text("epoch ", *epoch, " is collected: the oldest one kept is ", (*oldest)->value));
  }
  auto root = ReadRow(engine, partition, RootRow(*epoch), DecodeEpoch);
  if (!root.ok()) return root.status();
  if (*root) return **std::move(root);
  return absl::DataLossError(Text("map ", map, ": the root of epoch ", *epoch, " is missing"));
}

}  // namespace

absl::StatusOr<std::unique_ptr<const Snapshot::State>> OpenState(MapStore::State& store, std::string_view map,
                                                                 std::optional<uint64_t> epoch) {
  absl::Status refused;
  for (int i = 0; i < kTries; ++i) {
    auto record = ReadRow(store.engine, kCatalogue, CatalogueRow(map), DecodeMap);
    if (!record.ok()) return record.status();
    if (!*record) return absl::NotFoundError(Text("there is no map ", map));
    const uint64_t incarnation = (*record)->value.incarnation;
    auto row = ReadEpoch(store.engine, incarnation, map, epoch);
    if (!row.ok()) return row.status();
    auto hold = store.pins.Pin(incarnation, row->value.epoch);
    if (!hold.ok()) {
      refused = hold.status();
      // The head that was read may be collected by now; an epoch that was asked for stays collected.
      if (absl::IsFailedPrecondition(refused) && !epoch) continue;
      return refused;
    }
    (*record)->value.origin = row->value.origin;
    return std::unique_ptr<const Snapshot::State>(
        new Snapshot::State{(*record)->value, std::move(row->value), std::move(row->bytes),
                            MapValues(store.engine, store.caches, incarnation), *std::move(hold), store.engine});
  }
  return refused;
}

Snapshot::Snapshot(std::unique_ptr<const State> state) : state_(std::move(state)) {}
Snapshot::~Snapshot() = default;

uint64_t Snapshot::epoch() const { return state_->at.epoch; }
const MapRecord& Snapshot::map() const { return state_->map; }
uint64_t Snapshot::sessions() const { return state_->at.sessions; }

const MapTotals& Snapshot::totals() const {
  static constexpr MapTotals kEmpty;
  return state_->at.root ? state_->at.root->totals : kEmpty;
}

std::optional<BlockRange> Snapshot::bounds() const {
  return state_->at.root ? std::optional(state_->at.root->bounds) : std::nullopt;
}

absl::StatusOr<std::shared_ptr<const Block>> Snapshot::Read(BlockKey key) const {
  const absl::StatusOr<std::optional<TreeChild>> entry = FindBlock(state_->values, state_->at.root, key);
  if (!entry.ok()) return Explain(*state_, entry.status());
  if (!*entry) return nullptr;
  const ValueName name{ValueKind::kBlock, static_cast<uint64_t>(key), (*entry)->written};
  absl::StatusOr<std::shared_ptr<const Block>> block = state_->values.ReadBlock(name);
  if (!block.ok()) return Explain(*state_, block.status());
  return block;
}

absl::StatusOr<std::vector<TileKey>> Snapshot::Tiles(const std::optional<BlockRange>& range) const {
  std::vector<TileKey> tiles;
  const absl::Status visited =
      VisitLeaves(state_->values, state_->at.root, range, [&tiles](TileKey tile, const TreeNode&) {
        tiles.push_back(tile);
        return absl::OkStatus();
      });
  if (!visited.ok()) return Explain(*state_, visited);
  return tiles;
}

absl::StatusOr<std::vector<TileEntry>> Snapshot::TileEntries(const std::optional<BlockRange>& range) const {
  std::vector<TileEntry> tiles;
  const absl::Status visited =
      VisitTiles(state_->values, state_->at.root, range, [&tiles](TileKey tile, const TreeChild& entry) {
        if (entry.totals.static_voxels > 0) tiles.push_back({tile, entry.written, entry.totals});
        return absl::OkStatus();
      });
  if (!visited.ok()) return Explain(*state_, visited);
  return tiles;
}

absl::StatusOr<std::optional<TileEntry>> Snapshot::FindTile(TileKey tile) const {
  constexpr int32_t kTileSize = 1 << kTileBits;
  const VoxelIndex index = TileIndexOf(tile);
  const VoxelIndex first{kTileSize * index.x, kTileSize * index.y, 0};
  const absl::StatusOr<std::vector<TileEntry>> found =
      TileEntries(BlockRange{first, {first.x + kTileSize - 1, first.y + kTileSize - 1, 0}});
  if (!found.ok()) return found.status();
  for (const TileEntry& entry : *found) {
    if (entry.key == tile) return entry;
  }
  return std::nullopt;
}

absl::StatusOr<std::vector<BlockKey>> Snapshot::BlocksOf(TileKey tile) const {
  const absl::StatusOr<std::vector<BlockEntry>> entries = BlockEntries(tile);
  if (!entries.ok()) return entries.status();
  std::vector<BlockKey> blocks;
  for (const BlockEntry& entry : *entries) blocks.push_back(entry.key);
  return blocks;
}

absl::StatusOr<std::vector<BlockEntry>> Snapshot::BlockEntries(TileKey tile) const {
  const absl::StatusOr<std::shared_ptr<const TreeNode>> leaf = FindLeaf(state_->values, state_->at.root, tile);
  if (!leaf.ok()) return Explain(*state_, leaf.status());
  std::vector<BlockEntry> blocks;
  if (*leaf == nullptr) return blocks;
  for (const TreeChild& child : (*leaf)->children) {
    blocks.push_back({BlockKey{(*leaf)->prefix << kLeafBits | child.slot}, child.written, child.totals.static_voxels});
  }
  return blocks;
}

absl::StatusOr<std::vector<std::shared_ptr<const Block>>> Snapshot::ReadTile(TileKey tile) const {
  const absl::StatusOr<std::vector<BlockEntry>> entries = BlockEntries(tile);
  if (!entries.ok()) return entries.status();
  std::vector<ValueName> names;
  names.reserve(entries->size());
  for (const BlockEntry& entry : *entries) {
    names.push_back({ValueKind::kBlock, static_cast<uint64_t>(entry.key), entry.version});
  }
  absl::StatusOr<std::vector<std::shared_ptr<const Block>>> blocks = state_->values.ReadBlocks(names);
  if (!blocks.ok()) return Explain(*state_, blocks.status());
  return blocks;
}

absl::StatusOr<std::optional<std::string>> Snapshot::ReadDerived(const TileEntry& tile) const {
  return state_->values.ReadDerived({ValueKind::kLeaf, static_cast<uint64_t>(tile.key), tile.version});
}

absl::Status Snapshot::StoreDerived(const TileEntry& tile, std::string_view bytes) const {
  if (!state_->hold->Stands()) {
    return absl::FailedPreconditionError(Text("the pin of epoch ", state_->at.epoch, " has expired"));
  }
  return mapkeep::StoreDerived(state_->engine, state_->map.incarnation,
                               {ValueKind::kLeaf, static_cast<uint64_t>(tile.key), tile.version}, bytes);
}

absl::StatusOr<std::vector<BlockKey>> Snapshot::BlocksChangedSince(const Snapshot& before) const {
  const State& old = *before.state_;
  if (old.map.incarnation != state_->map.incarnation) {
    return absl::InvalidArgumentError(Text("snapshots of two maps, ", old.map.name, " and ", state_->map.name));
  }
  absl::StatusOr<TreeDifference> difference = CompareTrees(state_->values, old.at.root, state_->at.root);
  if (!difference.ok()) return Explain(old, Explain(*state_, difference.status()));
  return std::move(difference->blocks);
}

}  // namespace mapkeep
