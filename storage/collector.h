#pragma once

#include <absl/status/statusor.h>

#include <cstdint>

#include "core/geometry/progress.h"
#include "storage/clock.h"
#include "storage/engine.h"

namespace mapkeep {

struct GarbageOptions {
  uint64_t keep_epochs = 1000;   ///< the newest epochs of a map that stay readable, at least 1
  double keep_seconds = 0;       ///< epochs that were the newest one so recently stay, too, whatever their number
  double grace_seconds = 30;     ///< how long leases of the dead are honoured beyond their end: clocks differ
  double values_per_second = 0;  ///< at most so many are deleted, so that reads and commits have the disk; 0: no limit
  Clock now = SystemSeconds;
};

/// What one collection took away.
struct GarbageCounts {
  uint64_t epochs = 0;    ///< that can no longer be read
  uint64_t values = 0;    ///< blocks and tree nodes, of epochs and of attempts that died
  uint64_t attempts = 0;  ///< commits that never finished
  uint64_t maps = 0;      ///< deleted, or never finished being made
  uint64_t sessions = 0;  ///< deletions of scans or sessions that had been broken off
  bool operator==(const GarbageCounts&) const = default;
};

/// Collects what no reader and no commit can need. Runs beside both, in any number of processes, may be broken off
/// anywhere. CANCELLED when `progress` says stop. Why it is safe:
/// - An expired attempt is ended by deleting its intent with a compare-and-set; the commit's own compare-and-set
/// requires
///   the intent, so the attempt cannot be applied any more. Only then are its values deleted, and not if it is the
///   attempt that `applied/<session>` names or one that was rolled back (its intent can come back when a write that
///   timed out is applied late).
/// - `superseded/<e>` names what no epoch from e on reaches. The oldest epoch is raised first, by compare-and-set; a
///   reader's pin requires it unchanged, so every pin that could matter is there when the pins are read after it.
///   Then what lies below the lower of the two goes: roots first, values next, the rows that name them last.
/// - What a tagged epoch reaches stays: each name of a superseded row is looked up in the trees of the tagged epochs.
/// The
///   tags are read, as one row, after the oldest epoch is raised: a tag made later names an epoch from that one on, or
///   one that another tag keeps. They are read before the pins: a pin of a tagged epoch requires the tags unchanged.
/// - A rollback takes the values that it brings back out of their rows in the step that makes them reachable; it
/// requires
///   the oldest epoch and the tags unchanged, so that they were not collected before, and a row that the collector
///   shortens meanwhile is written by compare-and-set. See map_rollback.cc.
/// - An expired pin is deleted by compare-and-set, too, and its owner can only renew what is there.
absl::StatusOr<GarbageCounts> CollectGarbage(Engine& engine, const GarbageOptions& options,
                                             const Progress& progress = {});

}  // namespace mapkeep
