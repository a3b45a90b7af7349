#include "storage/map_diff.h"

#include <absl/container/flat_hash_map.h>

#include <memory>

#include "storage/map_tree.h"

namespace mapkeep {
namespace {

/// Voxels of a snapshot, its blocks held while this lives. Notes the first error.
class HeldBlocks {
 public:
  explicit HeldBlocks(const Snapshot& snapshot) : snapshot_(snapshot) {}

  const Voxel* Find(VoxelKey key) {
    const BlockKey block_key = BlockKeyOf(key);
    auto found = blocks_.find(block_key);
    if (found == blocks_.end()) {
      auto block = snapshot_.Read(block_key);
      if (!block.ok()) status_.Update(block.status());
      found = blocks_.emplace(block_key, block.ok() ? *std::move(block) : nullptr).first;
    }
    return found->second == nullptr ? nullptr : FindVoxel(*found->second, PositionInBlock(key));
  }

  const absl::Status& status() const { return status_; }

 private:
  const Snapshot& snapshot_;
  absl::flat_hash_map<BlockKey, std::shared_ptr<const Block>> blocks_;
  absl::Status status_;
};

}  // namespace

absl::StatusOr<BlockChange> ChangeOf(const Snapshot& before, const Snapshot& after, BlockKey key,
                                     const ChangeParameters& parameters) {
  const auto old_block = before.Read(key);
  if (!old_block.ok()) return old_block.status();
  const auto new_block = after.Read(key);
  if (!new_block.ok()) return new_block.status();
  return CompareBlocks(key, old_block->get(), new_block->get(), parameters);
}

absl::StatusOr<std::vector<ChangedObject>> ChangedObjectsBetween(const Snapshot& before, const Snapshot& after,
                                                                 std::span<const BlockChange> changes,
                                                                 const ChangedObjectParameters& parameters) {
  HeldBlocks old_blocks(before), new_blocks(after);
  auto objects = FindChangedObjects(
      changes, [&](VoxelKey key) { return old_blocks.Find(key); }, [&](VoxelKey key) { return new_blocks.Find(key); },
      after.map().voxel_size, parameters);
  if (!old_blocks.status().ok()) return old_blocks.status();
  if (!new_blocks.status().ok()) return new_blocks.status();
  return objects;
}

absl::Status CompareSnapshots(const Snapshot& before, const Snapshot& after,
                              const std::function<absl::Status(const BlockChange&)>& change) {
  const absl::StatusOr<std::vector<BlockKey>> keys = after.BlocksChangedSince(before);
  if (!keys.ok()) return keys.status();
  for (const BlockKey key : *keys) {
    const absl::StatusOr<BlockChange> found = ChangeOf(before, after, key);
    if (!found.ok()) return found.status();
    if (found->empty()) continue;
    if (absl::Status status = change(*found); !status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace mapkeep
