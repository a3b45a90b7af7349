#include "storage/map_tree.h"

#include <algorithm>

namespace mapkeep {
namespace {

bool TouchesColumns(const BlockRange& a, const BlockRange& b) {
  return a.first.x <= b.last.x && b.first.x <= a.last.x && a.first.y <= b.last.y && b.first.y <= a.last.y;
}

using LeafVisitor = std::function<absl::Status(TileKey, const TreeNode&)>;

absl::Status VisitNode(const MapValues& values, const ValueName& name, const std::optional<BlockRange>& range,
                       const LeafVisitor& leaf) {
  const absl::StatusOr<std::shared_ptr<const TreeNode>> node = values.ReadNode(name);
  if (!node.ok()) return node.status();
  const auto wanted = [&range](const TreeChild& child) { return !range || TouchesColumns(child.bounds, *range); };
  if ((*node)->level == 0) {
    if (!std::ranges::any_of((*node)->children, wanted)) return absl::OkStatus();
    return leaf(TileKey{static_cast<uint32_t>((*node)->prefix)}, **node);
  }
  for (const TreeChild& child : (*node)->children) {
    if (!wanted(child)) continue;
    const ValueName below = NameOfChild((*node)->level, (*node)->prefix, child);
    if (absl::Status status = VisitNode(values, below, range, leaf); !status.ok()) return status;
  }
  return absl::OkStatus();
}

using TileVisitor = std::function<absl::Status(TileKey, const TreeChild&)>;

absl::Status VisitTilesBelow(const MapValues& values, const ValueName& name, const std::optional<BlockRange>& range,
                             const TileVisitor& tile) {
  const absl::StatusOr<std::shared_ptr<const TreeNode>> node = values.ReadNode(name);
  if (!node.ok()) return node.status();
  for (const TreeChild& child : (*node)->children) {
    if (range && !TouchesColumns(child.bounds, *range)) continue;
    const ValueName below = NameOfChild((*node)->level, (*node)->prefix, child);
    absl::Status status = (*node)->level == 1 ? tile(TileKey{static_cast<uint32_t>(below.place)}, child)
                                              : VisitTilesBelow(values, below, range, tile);
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

class Editor {
 public:
  Editor(const MapValues& values, const WriteId& id) : values_(values), id_(id) {}

  /// The node after the changes below it, or nothing if it is empty then. `old` is its entry before.
  absl::StatusOr<std::optional<TreeChild>> Edit(int level, uint64_t prefix, const TreeChild* old,
                                                std::span<const TreeChange> changes) {
    TreeNode before;
    if (old != nullptr) {
      const ValueName name{static_cast<ValueKind>(level), prefix, old->written};
      const absl::StatusOr<std::shared_ptr<const TreeNode>> read = values_.ReadNode(name);
      if (!read.ok()) return read.status();
      before = **read;
      edit_.superseded.push_back(name);
    }
    TreeNode after{level, prefix, {}};
    auto next = before.children.begin();
    while (!changes.empty()) {
      const uint32_t slot = SlotAt(level, changes.front().key);
      for (; next != before.children.end() && next->slot < slot; ++next) after.children.push_back(*next);
      const TreeChild* child = next != before.children.end() && next->slot == slot ? &*next++ : nullptr;
      const size_t same =
          std::ranges::find_if(changes, [&](const TreeChange& change) { return SlotAt(level, change.key) != slot; }) -
          changes.begin();
      absl::StatusOr<std::optional<TreeChild>> changed = EditChild(after, slot, child, changes.first(same));
      if (!changed.ok()) return changed.status();
      if (*changed) after.children.push_back(**changed);
      changes = changes.subspan(same);
    }
    after.children.insert(after.children.end(), next, before.children.end());
    if (after.children.empty()) return std::nullopt;
    const TreeChild entry = ChildOf(after, id_);
    edit_.written.emplace_back(ValueName{static_cast<ValueKind>(level), prefix, id_},
                               std::make_shared<const TreeNode>(std::move(after)));
    return entry;
  }

  TreeEdit Take(const TreeRoot& root) {
    edit_.root = root;
    return std::move(edit_);
  }

 private:
  absl::StatusOr<std::optional<TreeChild>> EditChild(const TreeNode& parent, uint32_t slot, const TreeChild* old,
                                                     std::span<const TreeChange> changes) {
    if (parent.level > 0) return Edit(parent.level - 1, parent.prefix << kDirectoryBits | slot, old, changes);
    if (old != nullptr) edit_.superseded.push_back(NameOfChild(0, parent.prefix, *old));
    return changes.front().block;
  }

  const MapValues& values_;
  const WriteId id_;
  TreeEdit edit_;
};

class Comparer {
 public:
  explicit Comparer(const MapValues& values) : values_(values) {}

  /// Of the values at one place, either of which may be missing. Level -1 is a block.
  absl::Status Compare(int level, uint64_t prefix, const TreeChild* before, const TreeChild* after) {
    if (before != nullptr && after != nullptr && before->written == after->written) return absl::OkStatus();
    const ValueKind kind = level < 0 ? ValueKind::kBlock : static_cast<ValueKind>(level);
    if (before != nullptr) difference_.only_before.push_back({kind, prefix, before->written});
    if (after != nullptr) difference_.only_after.push_back({kind, prefix, after->written});
    if (level < 0) {
      difference_.blocks.push_back(BlockKey{prefix});
      return absl::OkStatus();
    }
    const absl::StatusOr<NodePointer> old_node = Read(kind, prefix, before);
    if (!old_node.ok()) return old_node.status();
    const absl::StatusOr<NodePointer> new_node = Read(kind, prefix, after);
    if (!new_node.ok()) return new_node.status();
    return CompareChildren(level, prefix, **old_node, **new_node);
  }

  TreeDifference Take() { return std::move(difference_); }

 private:
  using NodePointer = std::shared_ptr<const TreeNode>;

  absl::StatusOr<NodePointer> Read(ValueKind kind, uint64_t prefix, const TreeChild* entry) const {
    if (entry == nullptr) return std::make_shared<const TreeNode>();
    return values_.ReadNode({kind, prefix, entry->written});
  }

  absl::Status CompareChildren(int level, uint64_t prefix, const TreeNode& before, const TreeNode& after) {
    const int bits = level == 0 ? kLeafBits : kDirectoryBits;
    auto a = before.children.begin();
    auto b = after.children.begin();
    while (a != before.children.end() || b != after.children.end()) {
      const bool in_a = b == after.children.end() || (a != before.children.end() && a->slot <= b->slot);
      const bool in_b = a == before.children.end() || (b != after.children.end() && b->slot <= a->slot);
      const uint64_t below = prefix << bits | (in_a ? a->slot : b->slot);
      absl::Status status = Compare(level - 1, below, in_a ? &*a : nullptr, in_b ? &*b : nullptr);
      if (!status.ok()) return status;
      if (in_a) ++a;
      if (in_b) ++b;
    }
    return absl::OkStatus();
  }

  const MapValues& values_;
  TreeDifference difference_;
};

}  // namespace

absl::StatusOr<TreeDifference> CompareTrees(const MapValues& values, const TreeRoot& before, const TreeRoot& after) {
  if (!before && !after) return TreeDifference();
  Comparer comparer(values);
  const absl::Status compared = comparer.Compare(kRootLevel, 0, before ? &*before : nullptr, after ? &*after : nullptr);
  if (!compared.ok()) return compared;
  return comparer.Take();
}

absl::StatusOr<bool> Reaches(const MapValues& values, const TreeRoot& root, const ValueName& name) {
  if (!root) return false;
  const int wanted = name.kind == ValueKind::kBlock ? -1 : static_cast<int>(name.kind);
  const BlockKey key{wanted < 0 ? name.place : name.place << BitsBelow(wanted)};
  WriteId written = root->written;
  for (int level = kRootLevel; level > wanted; --level) {
    const auto node = values.ReadNode({static_cast<ValueKind>(level), PrefixAt(level, key), written});
    if (!node.ok()) return node.status();
    const TreeChild* child = FindChild(**node, SlotAt(level, key));
    if (child == nullptr) return false;
    written = child->written;
  }
  return written == name.written;
}

absl::StatusOr<std::shared_ptr<const TreeNode>> FindLeaf(const MapValues& values, const TreeRoot& root, TileKey tile) {
  if (!root) return nullptr;
  const BlockKey key{uint64_t{static_cast<uint32_t>(tile)} << kLeafBits};
  absl::StatusOr<std::shared_ptr<const TreeNode>> node = values.ReadNode(NameOfRoot(*root));
  while (node.ok() && (*node)->level > 0) {
    const int level = (*node)->level;
    const TreeChild* child = FindChild(**node, SlotAt(level, key));
    if (child == nullptr) return nullptr;
    node = values.ReadNode(NameOfChild(level, (*node)->prefix, *child));
  }
  return node;
}

absl::StatusOr<std::optional<TreeChild>> FindBlock(const MapValues& values, const TreeRoot& root, BlockKey key) {
  const absl::StatusOr<std::shared_ptr<const TreeNode>> leaf = FindLeaf(values, root, TileKeyOf(key));
  if (!leaf.ok()) return leaf.status();
  const TreeChild* block = *leaf == nullptr ? nullptr : FindChild(**leaf, SlotAt(0, key));
  return block == nullptr ? std::nullopt : std::optional(*block);
}

absl::Status VisitLeaves(const MapValues& values, const TreeRoot& root, const std::optional<BlockRange>& range,
                         const LeafVisitor& leaf) {
  if (!root || (range && !TouchesColumns(root->bounds, *range))) return absl::OkStatus();
  return VisitNode(values, NameOfRoot(*root), range, leaf);
}

absl::Status VisitTiles(const MapValues& values, const TreeRoot& root, const std::optional<BlockRange>& range,
                        const TileVisitor& tile) {
  if (!root || (range && !TouchesColumns(root->bounds, *range))) return absl::OkStatus();
  return VisitTilesBelow(values, NameOfRoot(*root), range, tile);
}

absl::StatusOr<TreeEdit> EditTree(const MapValues& values, const TreeRoot& root, std::span<const TreeChange> changes,
                                  const WriteId& id) {
  Editor editor(values, id);
  if (changes.empty()) return editor.Take(root);
  const absl::StatusOr<TreeRoot> edited = editor.Edit(kRootLevel, 0, root ? &*root : nullptr, changes);
  if (!edited.ok()) return edited.status();
  return editor.Take(*edited);
}

}  // namespace mapkeep
