#include "storage/map_values.h"

#include <map>
#include <string>
#include <vector>

#include "storage/block_codec.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

std::string Describe(const ValueName& name) {
  if (name.kind != ValueKind::kBlock) return Text("tree node ", Hex(name.place));
  const VoxelIndex block = BlockIndexOf(BlockKey{name.place});
  return Text("block (", block.x, ", ", block.y, ", ", block.z, ")");
}

/// Why a value could not be read: one that a tree names must be there, and whole.
absl::Status Explain(const absl::Status& status, const ValueName& name) {
  if (absl::IsNotFound(status)) return absl::DataLossError(Text(Describe(name), " is missing"));
  if (absl::IsDataLoss(status)) return absl::DataLossError(Text(Describe(name), ": ", FromAbsl(status.message())));
  return status;
}

absl::StatusOr<std::string> ReadValue(const Engine& engine, uint64_t incarnation, const ValueName& name) {
  absl::StatusOr<std::string> value = engine.GetValue(GroupOf(incarnation, name), KeyOf(name));
  if (!value.ok()) return Explain(value.status(), name);
  return value;
}

}  // namespace

absl::StatusOr<std::shared_ptr<const Block>> MapValues::ReadBlock(const ValueName& name) const {
  if (std::shared_ptr<const Block> cached = caches_.blocks.Find({incarnation_, name})) return cached;
  const absl::StatusOr<std::string> value = ReadValue(engine_, incarnation_, name);
  if (!value.ok()) return value.status();
  return Decode(name, *value);
}

absl::StatusOr<std::shared_ptr<const Block>> MapValues::Decode(const ValueName& name, std::string_view value) const {
  absl::StatusOr<Block> block = DecodeBlock(value, BlockKey{name.place});
  if (!block.ok()) return block.status();
  auto read = std::make_shared<const Block>(*std::move(block));
  Remember(name, read);
  return read;
}

absl::StatusOr<std::vector<std::shared_ptr<const Block>>> MapValues::ReadBlocks(
    std::span<const ValueName> names) const {
  std::vector<std::shared_ptr<const Block>> blocks(names.size());
  std::vector<size_t> missing;
  std::vector<std::string> keys;
  for (size_t i = 0; i < names.size(); ++i) {
    blocks[i] = caches_.blocks.Find({incarnation_, names[i]});
    if (blocks[i] != nullptr) continue;
    missing.push_back(i);
    keys.push_back(KeyOf(names[i]));
  }
  if (missing.empty()) return blocks;
  const auto values = engine_.GetValues(GroupOf(incarnation_, names.front()), keys);
  for (size_t m = 0; m < missing.size(); ++m) {
    const ValueName& name = names[missing[m]];
    if (!values[m].ok()) return Explain(values[m].status(), name);
    auto block = Decode(name, *values[m]);
    if (!block.ok()) return block.status();
    blocks[missing[m]] = *std::move(block);
  }
  return blocks;
}

absl::StatusOr<std::shared_ptr<const TreeNode>> MapValues::ReadNode(const ValueName& name) const {
  if (std::shared_ptr<const TreeNode> cached = caches_.nodes.Find({incarnation_, name})) return cached;
  const absl::StatusOr<std::string> value = ReadValue(engine_, incarnation_, name);
  if (!value.ok()) return value.status();
  absl::StatusOr<TreeNode> node = DecodeNode(*value, name);
  if (!node.ok()) return node.status();
  auto read = std::make_shared<const TreeNode>(*std::move(node));
  Remember(name, read);
  return read;
}

void MapValues::Remember(const ValueName& name, std::shared_ptr<const Block> block) const {
  const size_t bytes = sizeof(Block) + block->voxels.capacity() * sizeof(Voxel);
  caches_.blocks.Insert({incarnation_, name}, std::move(block), bytes);
}

void MapValues::Remember(const ValueName& name, std::shared_ptr<const TreeNode> node) const {
  const size_t bytes = sizeof(TreeNode) + node->children.capacity() * sizeof(TreeChild);
  caches_.nodes.Insert({incarnation_, name}, std::move(node), bytes);
}

absl::Status DeleteNamed(Engine& engine, uint64_t incarnation, std::span<const ValueName> names) {
  std::map<std::string, std::vector<std::string>> keys;
  for (const ValueName& name : names) keys[GroupOf(incarnation, name)].push_back(KeyOf(name));
  for (const auto& [group, in_group] : keys) {
    if (absl::Status status = engine.DeleteValues(group, in_group); !status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace mapkeep
