#include "storage/commit_plan.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <optional>

#include "storage/block_codec.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

/// What becomes of one given block.
struct Verdict {
  absl::Status status;
  bool changes = false;
  std::optional<WrittenBlock> kept;  ///< the block that is to be there; nothing: it goes
  std::string value;                 ///< to be written, unless an earlier round did
};

uint64_t StaticVoxels(const Block& block) {
  return std::ranges::count_if(block.voxels, [](const Voxel& voxel) { return voxel.is_static; });
}

Verdict Judge(const MapValues& values, const TreeRoot& root, Block block,
              const absl::flat_hash_map<BlockKey, WrittenBlock>& earlier, const WriteId& id) {
  const BlockKey key = block.key;
  const absl::StatusOr<std::optional<TreeChild>> stored = FindBlock(values, root, key);
  if (!stored.ok()) return {stored.status()};
  if (block.voxels.empty()) return {absl::OkStatus(), stored->has_value()};
  if (*stored && (*stored)->totals.voxels == block.voxels.size()) {
    const ValueName name{ValueKind::kBlock, static_cast<uint64_t>(key), (*stored)->written};
    const absl::StatusOr<std::shared_ptr<const Block>> before = values.ReadBlock(name);
    if (!before.ok()) return {before.status()};
    if (**before == block) return {};
  }
  if (const auto found = earlier.find(key); found != earlier.end() && *found->second.block == block) {
    return {absl::OkStatus(), true, found->second};
  }
  absl::StatusOr<std::string> value = EncodeBlock(block);
  if (!value.ok()) return {value.status()};
  const TreeChild entry = BlockChild(key, id, block.voxels.size(), StaticVoxels(block));
  return {absl::OkStatus(), true, WrittenBlock{std::make_shared<const Block>(std::move(block)), entry},
          *std::move(value)};
}

absl::Status CheckKeys(const std::vector<Block>& sorted) {
  for (size_t i = 0; i < sorted.size(); ++i) {
    if (static_cast<uint64_t>(sorted[i].key) >> BitsBelow(kRootLevel) != 0) {
      return absl::InvalidArgumentError(Text("block key ", Hex(static_cast<uint64_t>(sorted[i].key)), " has more than ",
                                             BitsBelow(kRootLevel), " bits"));
    }
    if (i > 0 && sorted[i].key == sorted[i - 1].key) {
      const VoxelIndex block = BlockIndexOf(sorted[i].key);
      return absl::InvalidArgumentError(Text("block (", block.x, ", ", block.y, ", ", block.z, ") is given twice"));
    }
  }
  return absl::OkStatus();
}

void AddValue(CommitPlan& plan, uint64_t incarnation, const ValueName& name, std::string value) {
  plan.names.push_back(name);
  std::string group = GroupOf(incarnation, name);
  if (plan.groups.empty() || plan.groups.back().group != group) plan.groups.push_back({std::move(group), {}});
  plan.groups.back().values.push_back({KeyOf(name), std::move(value)});
}

}  // namespace

absl::StatusOr<CommitPlan> PlanCommit(const MapValues& values, const TreeRoot& root, std::vector<Block> blocks,
                                      const absl::flat_hash_map<BlockKey, WrittenBlock>& earlier, const WriteId& id) {
  std::ranges::sort(blocks, {}, &Block::key);
  if (absl::Status status = CheckKeys(blocks); !status.ok()) return status;
  std::vector<Verdict> verdicts(blocks.size());
  tbb::parallel_for(size_t{0}, blocks.size(), [&](size_t i) {
    const BlockKey key = blocks[i].key;
    verdicts[i] = Judge(values, root, std::move(blocks[i]), earlier, id);
    blocks[i].key = key;
  });

  CommitPlan plan;
  std::vector<TreeChange> changes;
  std::vector<std::pair<ValueName, std::string>> written;
  for (size_t i = 0; i < blocks.size(); ++i) {
    Verdict& verdict = verdicts[i];
    if (!verdict.status.ok()) return verdict.status;
    if (!verdict.changes) continue;
    const BlockKey key = blocks[i].key;
    const TileKey tile = TileKeyOf(key);
    if (plan.touched_tiles.empty() || plan.touched_tiles.back() != tile) plan.touched_tiles.push_back(tile);
    changes.push_back({key, std::nullopt});
    if (!verdict.kept) continue;
    changes.back().block = verdict.kept->entry;
    if (!verdict.value.empty()) {
      const ValueName name{ValueKind::kBlock, static_cast<uint64_t>(key), id};
      written.emplace_back(name, std::move(verdict.value));
    }
    plan.blocks.emplace(key, *std::move(verdict.kept));
  }
  absl::StatusOr<TreeEdit> edit = EditTree(values, root, changes, id);
  if (!edit.ok()) return edit.status();
  plan.edit = *std::move(edit);
  for (const auto& [name, node] : plan.edit.written) written.emplace_back(name, EncodeNode(*node));

  // One batch a group: a tile's blocks and its leaf together.
  const uint64_t incarnation = values.incarnation();
  std::ranges::stable_sort(written, {}, [](const auto& value) -> uint64_t {
    const ValueName& name = value.first;
    if (name.kind == ValueKind::kBlock) return static_cast<uint32_t>(TileKeyOf(BlockKey{name.place}));
    return name.kind == ValueKind::kLeaf ? name.place : UINT64_MAX;
  });
  for (auto& [name, value] : written) AddValue(plan, incarnation, name, std::move(value));
  return plan;
}

}  // namespace mapkeep
