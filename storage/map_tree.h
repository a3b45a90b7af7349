#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "storage/map_values.h"
#include "storage/tree_node.h"

namespace mapkeep {

/// The root of one state of a map; nothing while the map is empty.
using TreeRoot = std::optional<TreeChild>;

/// The block's entry in the tree, or nothing.
absl::StatusOr<std::optional<TreeChild>> FindBlock(const MapValues& values, const TreeRoot& root, BlockKey key);

/// The leaf of a tile, or nullptr if the tree has none.
absl::StatusOr<std::shared_ptr<const TreeNode>> FindLeaf(const MapValues& values, const TreeRoot& root, TileKey tile);

/// Calls `leaf` in key order for each tile of the tree with a block whose column touches the range (no range: each).
absl::Status VisitLeaves(const MapValues& values, const TreeRoot& root, const std::optional<BlockRange>& range,
                         const std::function<absl::Status(TileKey tile, const TreeNode& leaf)>& leaf);

/// Calls `tile` in key order with the parent's entry of each leaf whose tile touches the range (no range: each). Reads
/// no leaf.
absl::Status VisitTiles(const MapValues& values, const TreeRoot& root, const std::optional<BlockRange>& range,
                        const std::function<absl::Status(TileKey tile, const TreeChild& entry)>& tile);

/// How two trees of one map differ.
struct TreeDifference {
  std::vector<ValueName> only_before, only_after;  ///< nodes and blocks
  std::vector<BlockKey> blocks;                    ///< in one only, or with another value; in order
};

/// Reads the nodes that differ alone: what both share is passed over.
absl::StatusOr<TreeDifference> CompareTrees(const MapValues& values, const TreeRoot& before, const TreeRoot& after);

/// Whether the tree reaches that value.
absl::StatusOr<bool> Reaches(const MapValues& values, const TreeRoot& root, const ValueName& name);

/// A block that is to be in the tree, or to leave it (no entry).
struct TreeChange {
  BlockKey key{};
  std::optional<TreeChild> block;
};

/// What a new tree needs written, and what of the old one it no longer reaches.
struct TreeEdit {
  TreeRoot root;
  std::vector<std::pair<ValueName, std::shared_ptr<const TreeNode>>> written;  ///< the new nodes
  std::vector<ValueName> superseded;                                           ///< nodes and blocks
};

/// Copy on write: the tree with the changes made (sorted by key, none twice, each a real change), its new nodes named
/// by `id`. Reads and makes the nodes on the paths to the changed blocks, whatever the size of the map. Writes nothing.
absl::StatusOr<TreeEdit> EditTree(const MapValues& values, const TreeRoot& root, std::span<const TreeChange> changes,
                                  const WriteId& id);

}  // namespace mapkeep
