#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/changes/changed_objects.h"
#include "storage/map_store.h"

namespace mapkeep {

/// Of one block; empty ones if it does not differ in this.
absl::StatusOr<BlockChange> ChangeOf(const Snapshot& before, const Snapshot& after, BlockKey key,
                                     const ChangeParameters& parameters = {});

/// The objects that the changes between two snapshots make up; `changes` as CompareSnapshots gives them, all of them.
absl::StatusOr<std::vector<ChangedObject>> ChangedObjectsBetween(const Snapshot& before, const Snapshot& after,
                                                                 std::span<const BlockChange> changes,
                                                                 const ChangedObjectParameters& parameters = {});

/// More changed voxels than this are not grouped to objects by whoever serves a comparison: they would fill its memory.
inline constexpr uint64_t kMostGroupedVoxels = uint64_t{1} << 22;

/// Calls `change` for each block with a difference between two snapshots of one map, in order of key. Reads what
/// differs alone: values that both epochs share are passed over unread. INVALID_ARGUMENT for snapshots of different
/// maps; errors of `change` are passed on.
absl::Status CompareSnapshots(const Snapshot& before, const Snapshot& after,
                              const std::function<absl::Status(const BlockChange&)>& change);

}  // namespace mapkeep
