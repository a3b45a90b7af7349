#include "storage/map_values.h"

#include <algorithm>
#include <map>
#include <utility>

#include "core/checksum/crc32c.h"
#include "storage/block_codec.h"
#include "storage/byte_planes.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr size_t kChecksumBytes = 4;

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

absl::StatusOr<std::optional<std::string>> MapValues::ReadDerived(const ValueName& leaf) const {
  const ValueName name = DerivedFrom(leaf);
  absl::StatusOr<std::string> value = engine_.GetValue(GroupOf(incarnation_, name), KeyOf(name));
  if (absl::IsNotFound(value.status())) return std::nullopt;
  if (!value.ok()) return value.status();
  const size_t size = value->size() - std::min(value->size(), kChecksumBytes);
  if (value->size() < kChecksumBytes ||
      NumberAt<kChecksumBytes>(value->data() + size) != Crc32c(std::string_view(*value).substr(0, size))) {
    return absl::DataLossError(Text("what was derived from tile ", Hex(leaf.place), ": its checksum does not match"));
  }
  value->resize(size);
  return *std::move(value);
}

void MapValues::Remember(const ValueName& name, std::shared_ptr<const Block> block) const {
  const size_t bytes = sizeof(Block) + block->voxels.capacity() * sizeof(Voxel);
  caches_.blocks.Insert({incarnation_, name}, std::move(block), bytes);
}

void MapValues::Remember(const ValueName& name, std::shared_ptr<const TreeNode> node) const {
  const size_t bytes = sizeof(TreeNode) + node->children.capacity() * sizeof(TreeChild);
  caches_.nodes.Insert({incarnation_, name}, std::move(node), bytes);
}

absl::Status StoreDerived(Engine& engine, uint64_t incarnation, const ValueName& leaf, std::string_view bytes) {
  const ValueName name = DerivedFrom(leaf);
  std::string value(bytes);
  AppendNumber<kChecksumBytes>(value, Crc32c(bytes));
  const ImmutableValue put{KeyOf(name), std::move(value)};
  return engine.PutValues(GroupOf(incarnation, name), {&put, 1});
}

absl::Status DeleteNamed(Engine& engine, uint64_t incarnation, std::span<const ValueName> names) {
  std::map<std::string, std::vector<std::string>> keys;
  for (const ValueName& name : names) {
    std::vector<std::string>& in_group = keys[GroupOf(incarnation, name)];
    in_group.push_back(KeyOf(name));
    if (name.kind == ValueKind::kLeaf) in_group.push_back(KeyOf(DerivedFrom(name)));
  }
  for (const auto& [group, in_group] : keys) {
    if (absl::Status status = engine.DeleteValues(group, in_group); !status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace mapkeep
