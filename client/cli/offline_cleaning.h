#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "client/readers/session_directory.h"

namespace mapkeep {

/// What a label file holds for each point of its scan file (SemanticKITTI's classes).
enum class LabelClass : uint32_t {
  kNoReturn = 0,  ///< the point lies at the sensor or is not there: neither kept nor removed
  kKept = 9,
  kRemoved = 251,
};

/// Counts and times of an offline cleaning. Times are wall-clock seconds of each stage.
struct CleaningReport {
  uint64_t scans = 0;
  uint64_t points = 0, points_removed = 0, points_restored = 0, no_returns = 0;
  uint64_t voxels = 0, dynamic_voxels = 0, ground_voxels = 0;
  double read_seconds = 0;    ///< files read and checked
  double remove_seconds = 0;  ///< statistics and verdict
  double label_seconds = 0;   ///< verdict a point
  double write_seconds = 0;
  bool removal_reads_files = false;  ///< the session did not fit in memory: remove_seconds includes reading
};

/// Told the stage at work and its share done, [0, 1]; returns false to stop.
using StageProgress = std::function<bool(const std::string& stage, double fraction)>;

/// Removes what moved from a session directory, with no server: writes `out`/labels/NAME.label (a LabelClass a point of
/// each scan, named like it) and `out`/static.pcd (the original points that were kept, in the session's frame).
/// Sessions up to kHeldBytes of scan files are held in memory, longer ones are read again for each pass. Runs on the
/// calling oneTBB arena. Errors of the input as ReadScan and RemoveDynamicObjects give them; FAILED_PRECONDITION or
/// UNKNOWN for what cannot be written; CANCELLED.
absl::StatusOr<CleaningReport> CleanSession(const SessionDirectory& directory, const std::filesystem::path& out,
                                            const StageProgress& progress);

inline constexpr uint64_t kHeldBytes = uint64_t{4} << 30;

}  // namespace mapkeep
