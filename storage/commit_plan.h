#pragma once

#include <absl/container/flat_hash_map.h>
#include <absl/status/statusor.h>

#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/voxels/block.h"
#include "storage/map_rows.h"
#include "storage/map_tree.h"
#include "storage/map_values.h"

namespace mapkeep {

/// A block that an attempt has written, and its entry.
struct WrittenBlock {
  std::shared_ptr<const Block> block;
  TreeChild entry;
};

/// What one round of a commit writes on top of one head: values first, then the head.
struct CommitPlan {
  TreeEdit edit;
  std::vector<TileKey> touched_tiles;  ///< in order
  std::vector<ValueName> names;        ///< of all that is written
  std::vector<ValueGroup> groups;
  absl::flat_hash_map<BlockKey, WrittenBlock> blocks;  ///< the changed ones, also those of an earlier round
};

/// Plans the commit of `blocks` (any order, none twice; an empty one deletes) on the tree at `root`. Blocks equal to
/// the stored ones change nothing; those equal to what `earlier` wrote keep that value. INVALID_ARGUMENT for blocks
/// that cannot be stored. Writes nothing.
absl::StatusOr<CommitPlan> PlanCommit(const MapValues& values, const TreeRoot& root, std::vector<Block> blocks,
                                      const absl::flat_hash_map<BlockKey, WrittenBlock>& earlier, const WriteId& id);

}  // namespace mapkeep
