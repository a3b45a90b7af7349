#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/tiling/tile_point.h"
#include "core/tiling/tile_tree.h"
#include "core/voxels/block.h"

namespace mapkeep {

/// The points of a node's tile, from the points of the node (of a leaf all, else those that its level keeps): without
/// those that the parent's level keeps. No parent: all of them.
std::vector<TilePoint> TileOf(std::vector<TilePoint> points, std::optional<int> parent_level);

/// Makes the tiles of a whole map from its blocks in one pass, in memory that does not grow with the map: the blocks
/// come in order of their keys, so that a square is complete when the next one begins. What stays is the tree itself,
/// about two hundred bytes a tile. The tree is the one that BuildTileTree gives, the tiles follow from it.
class TilePyramid {
 public:
  /// Called for each tile, children before their parents; an error ends everything. There may be no points.
  using Emit = std::function<absl::Status(const TileNodeId& node, std::span<const TilePoint> points)>;

  TilePyramid(const PointSelection& selection, Emit emit);

  /// The next block. INVALID_ARGUMENT if its key does not rise; errors of `emit` are passed on.
  absl::Status Add(const Block& block);

  /// Emits the rest and gives the tree (first_column and columns stay 0); nothing may be added any more.
  absl::StatusOr<std::vector<TileNode>> Finish();

 private:
  struct Square {
    TileNodeId id;
    uint64_t voxels = 0;
    TileBounds bounds;
    std::vector<Square> children;
  };
  // A finished square whose tile waits for the level of its parent.
  struct Part {
    Square square;
    std::vector<TilePoint> points;  // see TileOf
  };
  // A square that more columns may come to.
  struct Open {
    int level = 0;
    std::vector<Part> parts;
  };

  absl::Status EndColumn(std::optional<uint32_t> next);
  absl::StatusOr<Part> Close(Open open);
  static void Flatten(const Square& square, std::optional<size_t> parent, std::vector<TileNode>& tree);

  const PointSelection selection_;
  const Emit emit_;
  std::vector<Open> open_;      // levels fall
  std::optional<Part> column_;  // that blocks are being added to
  uint32_t column_key_ = 0;
  std::optional<BlockKey> last_;
};

}  // namespace mapkeep
