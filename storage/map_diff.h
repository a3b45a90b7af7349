#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "storage/map_store.h"

namespace mapkeep {

/// What became static and what ceased to be, in one block. Voxels in order of position, as the epoch has them that
/// holds them static.
struct BlockChange {
  Block appeared;     ///< static after, and absent or not static before
  Block disappeared;  ///< the other way round
};

/// Of one block; empty ones if it does not differ in this.
absl::StatusOr<BlockChange> ChangeOf(const Snapshot& before, const Snapshot& after, BlockKey key);

/// Calls `change` for each block with a difference between two snapshots of one map, in order of key. Reads what
/// differs alone: values that both epochs share are passed over unread. INVALID_ARGUMENT for snapshots of different
/// maps; errors of `change` are passed on.
absl::Status CompareSnapshots(const Snapshot& before, const Snapshot& after,
                              const std::function<absl::Status(const BlockChange&)>& change);

}  // namespace mapkeep
