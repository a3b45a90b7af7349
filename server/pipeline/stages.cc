#include "server/pipeline/stages.h"

#include <algorithm>

#include "core/voxels/normal.h"
#include "server/pipeline/parallel.h"

namespace mapkeep {
namespace {

// Points within this of the blocks that a session can touch may be matched to, metres on top of what refinement may
// move it.
constexpr double kTargetMargin = 2.0;

// The blocks of these keys, all there.
absl::StatusOr<std::vector<std::shared_ptr<const Block>>> ReadBlocks(const Snapshot& snapshot,
                                                                     std::span<const BlockKey> keys) {
  std::vector<std::shared_ptr<const Block>> blocks(keys.size());
  const absl::Status status = ParallelFor(keys.size(), [&](size_t i) -> absl::Status {
    auto block = snapshot.Read(keys[i]);
    if (!block.ok()) return block.status();
    blocks[i] = *std::move(block);
    return absl::OkStatus();
  });
  if (!status.ok()) return status;
  return blocks;
}

absl::StatusOr<RegistrationTarget> TargetNear(const Snapshot& base, std::span<const BlockRange> reach) {
  const double voxel_size = base.map().voxel_size;
  const absl::StatusOr<std::vector<BlockKey>> keys = BlocksWithin(base, reach);
  if (!keys.ok()) return keys.status();
  RegistrationTarget target{.voxel_size = voxel_size};
  const auto blocks = ReadBlocks(base, *keys);
  if (!blocks.ok()) return blocks.status();
  for (const auto& block : *blocks) {
    for (const Voxel& voxel : block->voxels) {
      if (!voxel.is_static) continue;
      target.points.push_back(MeanOf(*block, voxel, voxel_size));
      target.normals.push_back(DecodeNormal(voxel.normal));
    }
  }
  return target;
}

}  // namespace

absl::StatusOr<Alignment> AlignToMap(const Snapshot& base, const ScanSource& scans, const SessionOutline& outline,
                                     std::span<const Pose> priors, const AlignParameters& parameters,
                                     const Progress& progress) {
  if (base.totals().blocks == 0) return FoundMapFrame(scans, priors, parameters, progress);
  const double margin = parameters.max_correction + parameters.coarse_correspondence + kTargetMargin;
  const auto target = TargetNear(base, ReachOf(outline, priors, base.map().voxel_size, margin));
  if (!target.ok()) return target.status();
  return AlignSession(scans, priors, *target, parameters, progress);
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
                                            const SessionMapParameters& parameters, const Progress& progress) {
  const Labeller label = [&removal](size_t index, const Scan& scan) { return removal.Label(index, scan); };
  return BuildSessionMap(scans, poses, label, removal.evidence(), start_minutes, parameters, progress);
}

}  // namespace mapkeep
