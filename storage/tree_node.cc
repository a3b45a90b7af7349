#include "storage/tree_node.h"

#include <algorithm>
#include <array>
#include <tuple>

#include "storage/record_codec.h"
#include "storage/records.pb.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

/// x and y of a block range widened to the tiles they lie in.
BlockRange WholeTiles(BlockRange range) {
  constexpr int32_t kInTile = (1 << kTileBits) - 1;
  for (int32_t* corner : {&range.first.x, &range.first.y}) *corner &= ~kInTile;
  for (int32_t* corner : {&range.last.x, &range.last.y}) *corner |= kInTile;
  return range;
}

constexpr uint32_t SlotLimit(int level) { return 1U << (level == 0 ? kLeafBits : kDirectoryBits); }

/// Adds the write ids of a node's children to its message, each once; children count through them.
class WriterColumn {
 public:
  explicit WriterColumn(storage::Node& node) : node_(node) {}

  uint32_t IndexOf(const WriteId& id) {
    const auto found = std::ranges::find(ids_, id);
    if (found != ids_.end()) return found - ids_.begin();
    ids_.push_back(id);
    node_.add_attempts(id.attempt);
    node_.add_rounds(id.round);
    return ids_.size() - 1;
  }

 private:
  storage::Node& node_;
  std::vector<WriteId> ids_;  ///< few: searched one by one
};

bool ColumnsMatch(const storage::Node& node) {
  const int count = node.slots_size();
  const int sums = node.level() == 0 ? 0 : count;
  return count > 0 && node.attempts_size() == node.rounds_size() && node.writers_size() == count &&
         node.voxels_size() == count && node.static_voxels_size() == count && node.blocks_size() == sums &&
         node.tiles_size() == sums && node.bounds_size() == 6 * sums;
}

}  // namespace

bool TreeChild::operator==(const TreeChild& other) const {
  const auto all = [](const TreeChild& child) {
    return std::tie(child.slot, child.written, child.bounds.first, child.bounds.last);
  };
  return all(*this) == all(other) && totals == other.totals;
}

ValueName NameOfChild(int level, uint64_t prefix, const TreeChild& child) {
  if (level == 0) return {ValueKind::kBlock, prefix << kLeafBits | child.slot, child.written};
  return {static_cast<ValueKind>(level - 1), prefix << kDirectoryBits | child.slot, child.written};
}

BlockRange Union(const BlockRange& a, const BlockRange& b) {
  return {{std::min(a.first.x, b.first.x), std::min(a.first.y, b.first.y), std::min(a.first.z, b.first.z)},
          {std::max(a.last.x, b.last.x), std::max(a.last.y, b.last.y), std::max(a.last.z, b.last.z)}};
}

TreeChild BlockChild(BlockKey key, const WriteId& written, uint64_t voxels, uint64_t static_voxels) {
  const VoxelIndex index = BlockIndexOf(key);
  return {SlotAt(0, key), written, {voxels, static_voxels, 1, 0}, {index, index}};
}

TreeChild ChildOf(const TreeNode& node, const WriteId& written) {
  TreeChild sum{
      static_cast<uint32_t>(node.prefix & (SlotLimit(node.level + 1) - 1)), written, {}, node.children.front().bounds};
  for (const TreeChild& child : node.children) {
    sum.totals.voxels += child.totals.voxels;
    sum.totals.static_voxels += child.totals.static_voxels;
    sum.totals.blocks += child.totals.blocks;
    sum.totals.tiles += child.totals.tiles;
    sum.bounds = Union(sum.bounds, child.bounds);
  }
  if (node.level == 0) {
    sum.totals.tiles = 1;
    sum.bounds = WholeTiles(sum.bounds);
  }
  return sum;
}

const TreeChild* FindChild(const TreeNode& node, uint32_t slot) {
  const auto found = std::ranges::lower_bound(node.children, slot, {}, &TreeChild::slot);
  return found != node.children.end() && found->slot == slot ? &*found : nullptr;
}

std::string EncodeNode(const TreeNode& node) {
  storage::Node message;
  message.set_level(node.level);
  message.set_prefix(node.prefix);
  WriterColumn writers(message);
  for (const TreeChild& child : node.children) {
    message.add_slots(child.slot);
    message.add_writers(writers.IndexOf(child.written));
    message.add_voxels(child.totals.voxels);
    message.add_static_voxels(child.totals.static_voxels);
    if (node.level == 0) continue;
    message.add_blocks(child.totals.blocks);
    message.add_tiles(child.totals.tiles);
    for (const VoxelIndex& corner : {child.bounds.first, child.bounds.last}) {
      for (const int32_t coordinate : {corner.x, corner.y, corner.z}) message.add_bounds(coordinate);
    }
  }
  return EncodeRecord(message);
}

absl::StatusOr<TreeNode> DecodeNode(std::string_view value, const ValueName& name) {
  const int level = static_cast<int>(name.kind);
  const std::string what = Text("tree node ", Hex(name.place), " of level ", level);
  absl::StatusOr<storage::Node> message = DecodeRecord<storage::Node>(value, what);
  if (!message.ok()) return message.status();
  if (!ColumnsMatch(*message)) return absl::DataLossError(Text(what, ": its columns differ in length"));
  if (static_cast<int>(message->level()) != level || message->prefix() != name.place) {
    return absl::DataLossError(Text(what, ": this is another node's value"));
  }
  TreeNode node{level, name.place, {}};
  node.children.reserve(message->slots_size());
  for (int i = 0; i < message->slots_size(); ++i) {
    const uint32_t slot = message->slots(i);
    const uint32_t writer = message->writers(i);
    const bool sorted = i == 0 || slot > message->slots(i - 1);
    if (!sorted || slot >= SlotLimit(level) || writer >= static_cast<uint32_t>(message->attempts_size())) {
      return absl::DataLossError(Text(what, ": child ", i, " is out of order or range"));
    }
    const WriteId written{message->attempts(writer), message->rounds(writer)};
    if (level == 0) {
      const BlockKey key{name.place << kLeafBits | slot};
      node.children.push_back(BlockChild(key, written, message->voxels(i), message->static_voxels(i)));
      continue;
    }
    const MapTotals totals{message->voxels(i), message->static_voxels(i), message->blocks(i), message->tiles(i)};
    const auto bound = [&](int axis) { return message->bounds(6 * i + axis); };
    node.children.push_back({slot, written, totals, {{bound(0), bound(1), bound(2)}, {bound(3), bound(4), bound(5)}}});
  }
  return node;
}

}  // namespace mapkeep
