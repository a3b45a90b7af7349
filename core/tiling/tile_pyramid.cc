#include "core/tiling/tile_pyramid.h"

#include <absl/status/statusor.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "core/tiling/thinning_levels.h"

namespace mapkeep {

std::vector<TilePoint> TileOf(std::vector<TilePoint> points, std::optional<int> parent_level) {
  return parent_level ? ThinToLevel(points, *parent_level).rest : std::move(points);
}

TilePyramid::TilePyramid(const PointSelection& selection, Emit emit) : selection_(selection), emit_(std::move(emit)) {}

absl::Status TilePyramid::Add(const Block& block) {
  if (last_ && *last_ >= block.key) return absl::InvalidArgumentError("blocks must come in order of their keys");
  last_ = block.key;
  const auto becomes_points = [this](const Voxel& voxel) { return !selection_.static_only || voxel.is_static; };
  const auto voxels = static_cast<uint64_t>(std::ranges::count_if(block.voxels, becomes_points));
  if (voxels == 0) return absl::OkStatus();
  const uint32_t key = ColumnOf(block.key);
  if (column_ && column_key_ != key) {
    if (absl::Status status = EndColumn(key); !status.ok()) return status;
  }
  const VoxelIndex at = BlockIndexOf(block.key);
  if (!column_) {
    column_ = Part{{.id = NodeAround(key, 0), .bounds = {at, at}}, {}};
    column_key_ = key;
  }
  column_->square.voxels += voxels;
  column_->square.bounds = Union(column_->square.bounds, {at, at});
  AppendPoints(block, selection_, column_->points);
  return absl::OkStatus();
}

// Closes the squares that do not reach to the next column, and puts what they became into the lowest that does.
absl::Status TilePyramid::EndColumn(std::optional<uint32_t> next) {
  Part part = *std::exchange(column_, std::nullopt);
  const int level = next ? CommonLevel(column_key_, *next) : 0;
  while (!open_.empty() && (!next || open_.back().level < level)) {
    open_.back().parts.push_back(std::move(part));
    Open open = std::move(open_.back());
    open_.pop_back();
    absl::StatusOr<Part> closed = Close(std::move(open));
    if (!closed.ok()) return closed.status();
    part = *std::move(closed);
  }
  if (open_.empty() || open_.back().level != level) open_.push_back({level, {}});
  open_.back().parts.push_back(std::move(part));
  return absl::OkStatus();
}

absl::StatusOr<TilePyramid::Part> TilePyramid::Close(Open open) {
  Part whole;
  whole.square.id =
      NodeAround(open.parts.front().square.id.prefix << (2 * open.parts.front().square.id.level), open.level);
  whole.square.bounds = open.parts.front().square.bounds;
  for (const Part& part : open.parts) {
    whole.square.voxels += part.square.voxels;
    whole.square.bounds = Union(whole.square.bounds, part.square.bounds);
  }
  const bool leaf = IsLeaf(whole.square.voxels);
  for (Part& part : open.parts) {
    if (!leaf) {
      ThinnedPoints thinned = ThinToLevel(part.points, open.level);
      if (absl::Status status = emit_(part.square.id, thinned.rest); !status.ok()) return status;
      part.points = std::move(thinned.kept);
      whole.square.children.push_back(std::move(part.square));
    }
    std::ranges::move(part.points, std::back_inserter(whole.points));
    part.points = {};
  }
  return whole;
}

absl::StatusOr<std::vector<TileNode>> TilePyramid::Finish() {
  std::vector<TileNode> tree;
  if (!column_) return tree;  // a column is open from the first one on
  if (absl::Status status = EndColumn({}); !status.ok()) return status;
  const Part& root = open_.back().parts.back();
  if (absl::Status status = emit_(root.square.id, root.points); !status.ok()) return status;
  Flatten(root.square, {}, tree);
  return tree;
}

void TilePyramid::Flatten(const Square& square, std::optional<size_t> parent, std::vector<TileNode>& tree) {
  const size_t index = tree.size();
  tree.push_back({.id = square.id, .voxels = square.voxels, .bounds = square.bounds, .parent = parent});
  if (parent) tree[*parent].children.push_back(index);
  for (const Square& child : square.children) Flatten(child, index, tree);
}

}  // namespace mapkeep
