#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/voxels/block.h"
#include "storage/byte_cache.h"
#include "storage/engine.h"
#include "storage/map_layout.h"
#include "storage/tree_node.h"

namespace mapkeep {

/// Decoded values of every map, shared by all readers.
struct MapCaches {
  /// Nodes get an eighth of the bytes.
  explicit MapCaches(size_t limit_bytes) : blocks(limit_bytes / 8 * 7), nodes(limit_bytes / 8) {}

  using Name = std::pair<uint64_t, ValueName>;  ///< incarnation and value
  ByteCache<Name, Block> blocks;
  ByteCache<Name, TreeNode> nodes;
};

/// The immutable values of one map, read through the caches. DATA_LOSS naming the value if it is damaged or missing.
class MapValues final {
 public:
  /// Both outlive it.
  MapValues(const Engine& engine, MapCaches& caches, uint64_t incarnation)
      : engine_(engine), caches_(caches), incarnation_(incarnation) {}

  uint64_t incarnation() const { return incarnation_; }
  absl::StatusOr<std::shared_ptr<const Block>> ReadBlock(const ValueName& name) const;
  /// Likewise several blocks of one tile, in their order; those that are not cached are read together.
  absl::StatusOr<std::vector<std::shared_ptr<const Block>>> ReadBlocks(std::span<const ValueName> names) const;
  absl::StatusOr<std::shared_ptr<const TreeNode>> ReadNode(const ValueName& name) const;

  /// What StoreDerived put beside a leaf; nothing if nobody did. DATA_LOSS if it is damaged.
  absl::StatusOr<std::optional<std::string>> ReadDerived(const ValueName& leaf) const;

  /// Puts what was just written where the next reader looks.
  void Remember(const ValueName& name, std::shared_ptr<const Block> block) const;
  void Remember(const ValueName& name, std::shared_ptr<const TreeNode> node) const;

 private:
  absl::StatusOr<std::shared_ptr<const Block>> Decode(const ValueName& name, std::string_view value) const;

  const Engine& engine_;
  MapCaches& caches_;
  const uint64_t incarnation_;
};

/// Keeps bytes that follow from the content of a leaf's tile alone, until the leaf is deleted. Whoever calls holds a
/// pin on an epoch that reaches the leaf, so that it is not deleted before.
absl::Status StoreDerived(Engine& engine, uint64_t incarnation, const ValueName& leaf, std::string_view bytes);

/// Deletes values of a map by name, a group at a time, and with each leaf what was derived from it. What is not there
/// is fine.
absl::Status DeleteNamed(Engine& engine, uint64_t incarnation, std::span<const ValueName> names);

}  // namespace mapkeep
