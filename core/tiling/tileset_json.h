#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "core/tiling/tile_tree.h"

namespace mapkeep {

struct TilesetOptions {
  double voxel_size = 0.2;  ///< metres
  /// Where the tile of a node is, relative to the file that this becomes.
  std::function<std::string(const TileNode&)> tile_uri;
  /// Set: below `depth` levels of the tree a node with children becomes a tileset of its own, found there.
  std::function<std::string(const TileNode&)> tileset_uri;
  int depth = 0;
  /// Members of the tileset's "extras", as JSON with its braces; empty: none.
  std::string extras;
};

/// OGC 3D Tiles 1.1 (tileset.json) for the tree below `root`: explicit tiles with boxes around whole blocks, metres, z
/// up, additive refinement. A tile's geometric error is eight times the edge of the cells of its level, so that a
/// viewer that allows 16 pixels of error shows a point every second pixel. An empty tree gives a tileset with an empty
/// root.
std::string TilesetJson(std::span<const TileNode> nodes, size_t root, const TilesetOptions& options);

/// Metres: what a viewer misses that shows this node's tile and none below it; 0 for a leaf.
double GeometricError(const TileNode& node, double voxel_size);

}  // namespace mapkeep
