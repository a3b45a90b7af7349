#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "storage/engine.h"
#include "storage/map_store.h"

namespace mapkeep {

// The records of a map's commits: the newest lie as rows in its head partition, the older ones, a thousand together, in
// immutable values. So the partition stays small however long the map lives (an object of RADOS should have fewer than
// 100,000 rows).
//
//   row "sealed"                            epochs 1 to this one lie in segments
//   values "map/<incarnation>/history"
//     <first epoch>                         HistorySegment of kSegmentEpochs commits

inline constexpr uint64_t kSegmentEpochs = 1000;
inline constexpr std::string_view kSealedRow = "sealed";
std::string HistoryGroup(uint64_t incarnation);
std::string SegmentKey(uint64_t first_epoch);

/// Epochs up to which the map's records lie in segments; 0: none.
absl::StatusOr<uint64_t> SealedEpochs(const Engine& engine, uint64_t incarnation);

/// The record of the commit that made an epoch, if there is one.
absl::StatusOr<std::optional<CommitRecord>> FindCommitRecord(const Engine& engine, uint64_t incarnation,
                                                             uint64_t epoch);

/// Calls `visit` for every record, oldest first, until it fails.
absl::Status ForEachCommit(const Engine& engine, uint64_t incarnation,
                           const std::function<absl::Status(const CommitRecord&)>& visit);

/// Moves the oldest records into segments, whole ones, as long as at least `keep_rows` stay rows. Beside readers and
/// commits, in any number of processes: a segment is durable before the step that takes its rows away, and readers look
/// for the row first.
absl::Status SealHistory(Engine& engine, uint64_t incarnation, uint64_t keep_rows = 1000);

}  // namespace mapkeep
