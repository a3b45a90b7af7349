#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "storage/engine.h"
#include "storage/map_rows.h"

namespace mapkeep {

// The history of a map is a sequence of commits, and a tree: the parent of a session's epoch is the epoch before it,
// the parent of a rollback is the epoch that it brought back. What is in the map at an epoch are the sessions on its
// way up.

/// The record of the commit that made an epoch; DATA_LOSS if it is missing.
absl::StatusOr<CommitRecord> ReadCommit(const Engine& engine, uint64_t incarnation, uint64_t epoch);

/// Whether `epoch` is `state`'s own or lies on its way up. Reads a row a rollback.
absl::StatusOr<bool> IsAncestor(const Engine& engine, uint64_t incarnation, uint64_t epoch, const EpochState& state);

/// The commits of sessions that one of two epochs has in its history and the other has not.
struct HistoryDifference {
  std::vector<CommitRecord> only_a, only_b;
};

/// Reads the records down to where both histories meet.
absl::StatusOr<HistoryDifference> CompareHistories(const Engine& engine, uint64_t incarnation, uint64_t a, uint64_t b);

}  // namespace mapkeep
