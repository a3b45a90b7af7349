#include "core/tiling/tile_tree.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <bit>
#include <utility>

namespace mapkeep {
namespace {

constexpr int kTopLevel = 16;  // one square holds everything that a key can say
constexpr int kColumnShift = 16;

BlockKey FirstBlockOf(const TileNodeId& node) {
  return BlockKey{uint64_t{node.prefix} << (2 * node.level + kColumnShift)};
}

TileBounds BoundsOf(const TileColumn& column) {
  const VoxelIndex at = BlockIndexOf(BlockKey{uint64_t{column.key} << kColumnShift});
  return {{at.x, at.y, column.lowest}, {at.x, at.y, column.highest}};
}

class Builder {
 public:
  explicit Builder(std::span<const TileColumn> columns) : columns_(columns) {}

  void Add(size_t first, size_t count, std::optional<size_t> parent) {
    const std::span<const TileColumn> own = columns_.subspan(first, count);
    const size_t index = nodes_.size();
    TileNode node{.parent = parent, .first_column = first, .columns = count};
    const int level = CommonLevel(own.front().key, own.back().key);
    node.id = NodeAround(own.front().key, level);
    node.bounds = BoundsOf(own.front());
    for (const TileColumn& column : own) {
      node.voxels += column.voxels;
      node.bounds = Union(node.bounds, BoundsOf(column));
    }
    const bool leaf = level == 0 || IsLeaf(node.voxels);
    nodes_.push_back(std::move(node));
    if (parent) nodes_[*parent].children.push_back(index);
    if (leaf) return;
    for (size_t begin = 0; begin < count;) {
      const TileNodeId quarter = NodeAround(own[begin].key, level - 1);
      size_t end = begin + 1;
      while (end < count && NodeAround(own[end].key, level - 1) == quarter) ++end;
      Add(first + begin, end - begin, index);
      begin = end;
    }
  }

  std::vector<TileNode> Take() { return std::move(nodes_); }

 private:
  const std::span<const TileColumn> columns_;
  std::vector<TileNode> nodes_;
};

}  // namespace

std::string NameOf(const TileNodeId& node) {
  const VoxelIndex at = BlockIndexOf(FirstBlockOf(node));
  return absl::StrCat(node.level, "_", at.x >> node.level, "_", at.y >> node.level);
}

std::optional<TileNodeId> TileNodeNamed(std::string_view name) {
  const std::vector<std::string> parts = absl::StrSplit(absl::string_view(name.data(), name.size()), '_');
  int level = 0;
  int32_t x = 0, y = 0;
  if (parts.size() != 3 || !absl::SimpleAtoi(parts[0], &level) || !absl::SimpleAtoi(parts[1], &x) ||
      !absl::SimpleAtoi(parts[2], &y)) {
    return {};
  }
  if (level < 0 || level > kTopLevel) return {};
  const int32_t limit = (1 << (kTopLevel - 1)) >> level;
  // Level 16 is the one square around everything, which begins at -2^15 blocks: -1 in squares.
  if (x < -std::max(limit, 1) || x >= std::max(limit, 0) || y < -std::max(limit, 1) || y >= std::max(limit, 0)) {
    return {};
  }
  const BlockKey key = BlockKeyOf({x * (1 << level), y * (1 << level), 0});
  const TileNodeId node = NodeAround(ColumnOf(key), level);
  // One spelling a node: no leading zeros or plus signs.
  if (NameOf(node) != name) return {};
  return node;
}

int CommonLevel(uint32_t a, uint32_t b) { return (static_cast<int>(std::bit_width(a ^ b)) + 1) / 2; }

TileNodeId NodeAround(uint32_t column, int level) {
  return {level, static_cast<uint32_t>(uint64_t{column} >> (2 * level))};
}

TileBounds Union(const TileBounds& a, const TileBounds& b) {
  return {{std::min(a.first.x, b.first.x), std::min(a.first.y, b.first.y), std::min(a.first.z, b.first.z)},
          {std::max(a.last.x, b.last.x), std::max(a.last.y, b.last.y), std::max(a.last.z, b.last.z)}};
}

std::vector<TileNode> BuildTileTree(std::span<const TileColumn> columns) {
  Builder builder(columns);
  if (!columns.empty()) builder.Add(0, columns.size(), {});
  return builder.Take();
}

}  // namespace mapkeep
