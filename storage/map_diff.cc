#include "storage/map_diff.h"

#include "storage/map_tree.h"

namespace mapkeep {
namespace {

/// Static voxels of `block` that `other` has not, or not static.
Block OnlyIn(const Block* block, const Block* other, BlockKey key) {
  Block only{key, {}};
  if (block == nullptr) return only;
  for (const Voxel& voxel : block->voxels) {
    if (!voxel.is_static) continue;
    const Voxel* same = other == nullptr ? nullptr : FindVoxel(*other, voxel.position);
    if (same == nullptr || !same->is_static) only.voxels.push_back(voxel);
  }
  return only;
}

}  // namespace

absl::StatusOr<BlockChange> ChangeOf(const Snapshot& before, const Snapshot& after, BlockKey key) {
  const auto old_block = before.Read(key);
  if (!old_block.ok()) return old_block.status();
  const auto new_block = after.Read(key);
  if (!new_block.ok()) return new_block.status();
  return BlockChange{OnlyIn(new_block->get(), old_block->get(), key), OnlyIn(old_block->get(), new_block->get(), key)};
}

absl::Status CompareSnapshots(const Snapshot& before, const Snapshot& after,
                              const std::function<absl::Status(const BlockChange&)>& change) {
  const absl::StatusOr<std::vector<BlockKey>> keys = after.BlocksChangedSince(before);
  if (!keys.ok()) return keys.status();
  for (const BlockKey key : *keys) {
    const absl::StatusOr<BlockChange> found = ChangeOf(before, after, key);
    if (!found.ok()) return found.status();
    if (found->appeared.voxels.empty() && found->disappeared.voxels.empty()) continue;
    if (absl::Status status = change(*found); !status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace mapkeep
