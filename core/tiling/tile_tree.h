#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/voxels/voxel_index.h"

namespace mapkeep {

// The levels of detail over a map: a quadtree over its block columns, in the order of block keys. A node of level L is
// a square of 2^L x 2^L columns of whatever height (6.4 m x 2^L at voxels of 0.2 m). Nodes with a single child are left
// out, and a node with few voxels is a leaf, however large its square.
//
// Refinement is additive: every point of the map is in exactly one tile. The tile of a node of level L holds the points
// that ThinToLevel keeps at L (a leaf: all), without those that its parent's level keeps.

/// A node's place.
struct TileNodeId {
  int level = 0;
  uint32_t prefix = 0;  ///< the leading 32 - 2 level bits of its column keys
  auto operator<=>(const TileNodeId&) const = default;
};

/// The leading 32 bits of a block's key, which all blocks above each other share.
constexpr uint32_t ColumnOf(BlockKey key) { return static_cast<uint32_t>(static_cast<uint64_t>(key) >> 16); }

/// "level_x_y": x and y count squares of that level from the map's origin. And back: nothing if it is no such name.
std::string NameOf(const TileNodeId& node);
std::optional<TileNodeId> TileNodeNamed(std::string_view name);

/// The lowest level whose squares hold both columns together.
int CommonLevel(uint32_t a, uint32_t b);
/// The node of that level around a column.
TileNodeId NodeAround(uint32_t column, int level);

/// Axis-aligned range of blocks, both ends inclusive.
struct TileBounds {
  VoxelIndex first, last;
  bool operator==(const TileBounds&) const = default;
};
TileBounds Union(const TileBounds& a, const TileBounds& b);

/// Whether a node with that many voxels is a leaf although it has several columns.
inline constexpr uint64_t kLeafVoxels = 4096;
constexpr bool IsLeaf(uint64_t voxels) { return voxels <= kLeafVoxels; }

/// What a map has in one column of blocks.
struct TileColumn {
  uint32_t key = 0;                 ///< ColumnOf
  uint64_t voxels = 0;              ///< that become points; never 0
  int32_t lowest = 0, highest = 0;  ///< blocks of it with such voxels
  bool operator==(const TileColumn&) const = default;
};

struct TileNode {
  TileNodeId id;
  uint64_t voxels = 0;
  TileBounds bounds;
  std::vector<size_t> children;          ///< by index, in order; none for a leaf
  std::optional<size_t> parent;          ///< nothing for the root
  size_t first_column = 0, columns = 0;  ///< of those that the tree was built from
};

/// The tree over columns in order of key; the root is the first node, parents come before their children. Empty without
/// columns.
std::vector<TileNode> BuildTileTree(std::span<const TileColumn> columns);

}  // namespace mapkeep
