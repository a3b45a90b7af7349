#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/voxels/voxel_index.h"
#include "storage/map_layout.h"
#include "storage/map_store.h"

namespace mapkeep {

// A map's tree is a radix tree over the 48 bits of block keys. A leaf (level 0) holds the blocks of one tile, by the
// low 20 bits of their keys; each directory level above takes 7 bits of the tile key, so that level 4 is the root and
// a path has five nodes however large the map is. Nodes are immutable values; a parent names a child by who wrote it.

inline constexpr int kRootLevel = 4;
inline constexpr int kLeafBits = 20;
inline constexpr int kDirectoryBits = 7;

/// A child of a node (a block, for a leaf), with the sums over what it holds.
struct TreeChild {
  uint32_t slot = 0;  ///< the key bits that tell it from its siblings
  WriteId written;
  MapTotals totals;
  BlockRange bounds;  ///< x and y to whole tiles, except of a block
  bool operator==(const TreeChild& other) const;
};

struct TreeNode {
  int level = 0;
  uint64_t prefix = 0;              ///< the key bits above its children's slots
  std::vector<TreeChild> children;  ///< by slot, none twice, at least one
};

/// Bits of a block key below a node of this level: its prefix is key >> BitsBelow(level).
constexpr int BitsBelow(int level) { return kLeafBits + kDirectoryBits * level; }
/// Prefix, and slot in it, of the child that leads to a block.
constexpr uint64_t PrefixAt(int level, BlockKey key) { return static_cast<uint64_t>(key) >> BitsBelow(level); }
constexpr uint32_t SlotAt(int level, BlockKey key) {
  const uint64_t below = static_cast<uint64_t>(key) & ((uint64_t{1} << BitsBelow(level)) - 1);
  return static_cast<uint32_t>(level == 0 ? below : below >> BitsBelow(level - 1));
}

/// The name of a child's value.
ValueName NameOfChild(int level, uint64_t prefix, const TreeChild& child);
inline ValueName NameOfRoot(const TreeChild& root) { return {ValueKind{kRootLevel}, 0, root.written}; }

/// The smallest range that holds both.
BlockRange Union(const BlockRange& a, const BlockRange& b);

/// The entry of a block in its leaf.
TreeChild BlockChild(BlockKey key, const WriteId& written, uint64_t voxels, uint64_t static_voxels);

/// What a node's parent says about it.
TreeChild ChildOf(const TreeNode& node, const WriteId& written);

/// The child with that slot, or nullptr.
const TreeChild* FindChild(const TreeNode& node, uint32_t slot);

/// A node's value, and back; DATA_LOSS if it is damaged or another node's.
std::string EncodeNode(const TreeNode& node);
absl::StatusOr<TreeNode> DecodeNode(std::string_view value, const ValueName& name);

}  // namespace mapkeep
