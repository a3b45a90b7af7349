#include "server/pipeline/stages.h"

#include <algorithm>
#include <mutex>

#include "server/pipeline/map_target.h"

namespace mapkeep {

absl::StatusOr<Alignment> AlignToMap(const Snapshot& base, PlanCache& plans, const ScanSource& scans,
                                     std::span<const Pose> poses, const std::optional<Pose>& prior,
                                     const std::optional<PositionPrior>& position, const AlignParameters& parameters,
                                     const Progress& progress) {
  if (base.totals().blocks == 0) return FoundMapFrame(scans, poses, parameters, progress);
  // While the plans of a large map are made nothing of the session is done, but it can be stopped.
  std::mutex mutex;
  double done = 0;
  const Progress told = [&](double fraction) {
    const std::lock_guard lock(mutex);
    done = fraction;
    return progress(fraction);
  };
  const PlanCache::GoesOn goes_on = [&] {
    const std::lock_guard lock(mutex);
    return !progress || progress(done);
  };
  return AlignSession(scans, poses, TargetOf(base, plans, goes_on, parameters.matcher), prior, parameters,
                      progress ? told : progress, position);
}

absl::StatusOr<Removal> CleanAgainstMap(const Snapshot& base, const ScanSource& scans, const SessionOutline& outline,
                                        std::span<const Pose> poses, DorParameters parameters,
                                        const Progress& progress) {
  parameters.voxel_size = base.map().voxel_size;
  const auto keys = BlocksWithin(base, ReachOf(outline, poses, parameters.voxel_size, 0));
  if (!keys.ok()) return keys.status();
  const auto blocks = ReadBlocks(base, *keys);
  if (!blocks.ok()) return blocks.status();
  std::vector<VoxelKey> watched;
  for (const auto& block : *blocks) {
    for (const Voxel& voxel : block->voxels) watched.push_back(VoxelKeyOf(block->key, voxel.position));
  }
  return RemoveDynamicObjects(scans, poses, watched, parameters, progress);
}

absl::StatusOr<SessionMap> SummariseSession(const ScanSource& scans, std::span<const Pose> poses,
                                            const Removal& removal, uint32_t start_minutes,
                                            const SessionMapParameters& parameters, const Progress& progress,
                                            LabelCounts* labels) {
  std::mutex mutex;  // guards *labels
  const Labeller label = [&](size_t index, const Scan& scan) {
    LabelCounts of_scan;
    std::vector<PointLabel> of_points = removal.Label(index, scan, &of_scan);
    const std::lock_guard lock(mutex);
    if (labels != nullptr) labels->Add(of_scan);
    return of_points;
  };
  return BuildSessionMap(scans, poses, label, removal.evidence(), start_minutes, parameters, progress);
}

}  // namespace mapkeep
