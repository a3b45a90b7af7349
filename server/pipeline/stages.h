#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/dor/remover.h"
#include "core/ratio_map/session_map.h"
#include "core/registration/aligner.h"
#include "server/config.h"
#include "server/pipeline/outline.h"
#include "server/pipeline/plan_cache.h"
#include "storage/map_store.h"

namespace mapkeep {

// A session's way into the map. Each stage is a plain function of its input, run on the calling oneTBB arena; the
// result does not depend on the number of threads. Poses are relative to the map's origin. All return CANCELLED when
// `progress` says stop and pass errors of the store on.

/// Stage "align": against the static voxels of `base`, from the `prior` (T_map_session) if there is one; the first
/// session of a map founds its frame.
absl::StatusOr<Alignment> AlignToMap(const Snapshot& base, PlanCache& plans, const ScanSource& scans,
                                     std::span<const Pose> poses, const std::optional<Pose>& prior,
                                     const std::optional<PositionPrior>& position, const AlignParameters& parameters,
                                     const Progress& progress);

/// Stage "clean": what moved, with exposures counted for the voxels of `base` that the session's rays can touch.
absl::StatusOr<Removal> CleanAgainstMap(const Snapshot& base, const ScanSource& scans, const SessionOutline& outline,
                                        std::span<const Pose> poses, DorParameters parameters,
                                        const Progress& progress);

/// Stage "merge": the session's ratio map. The counts of its points are added to `labels`, if given.
absl::StatusOr<SessionMap> SummariseSession(const ScanSource& scans, std::span<const Pose> poses,
                                            const Removal& removal, uint32_t start_minutes,
                                            const SessionMapParameters& parameters, const Progress& progress,
                                            LabelCounts* labels = nullptr);

/// What stage "commit" is given.
struct MergeInput {
  const Snapshot& base;  ///< that the session was aligned to, and its exposures counted against
  const SessionMap& session;
  const ScanSource& scans;            ///< to count again what the map gained since
  std::span<const Pose> poses;        ///< aligned
  std::span<const BlockRange> reach;  ///< of each scan's rays
  ExposureParameters exposure;        ///< as the session's own voxels were counted
};

/// The map's blocks after a merge, and the figures for the report.
struct MergeResult {
  std::vector<Block> changed;              ///< with new static flags, in order of key; empty ones are to be deleted
  uint64_t voxels = 0, static_voxels = 0;  ///< in the session's blocks after the merge
};

/// Stage "commit", as a function of the head to be replaced: eq. 8-9 over the touched blocks, then the map filter over
/// these and their neighbours. Voxels that the head has and the base had not get their exposures counted now.
absl::StatusOr<MergeResult> MergeIntoMap(const Snapshot& head, const MergeInput& input, const MergeParameters& merge,
                                         MapFilterParameters filter, const Progress& progress);

}  // namespace mapkeep
