#include "server/pipeline/map_target.h"

#include <cmath>
#include <utility>

#include "core/voxels/normal.h"
#include "server/pipeline/outline.h"
#include "server/pipeline/parallel.h"

namespace mapkeep {
namespace {

absl::StatusOr<RegistrationTarget> StaticVoxels(const Snapshot& base, std::span<const BlockRange> ranges) {
  const absl::StatusOr<std::vector<BlockKey>> keys = BlocksWithin(base, ranges);
  if (!keys.ok()) return keys.status();
  return StaticVoxels(base, *keys);
}

}  // namespace

absl::StatusOr<RegistrationTarget> StaticVoxels(const Snapshot& base, std::span<const BlockKey> keys) {
  const double voxel_size = base.map().voxel_size;
  RegistrationTarget target{.voxel_size = voxel_size};
  const auto blocks = ReadBlocks(base, keys);
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

TargetMap TargetOf(const Snapshot& base, PlanCache& plans, PlanCache::GoesOn goes_on,
                   const MatcherParameters& parameters) {
  TargetMap map;
  map.plan = [&base, &plans, goes_on = std::move(goes_on)] { return plans.PlanOf(base, goes_on); };
  map.points = [&base](std::span<const Eigen::AlignedBox3d> boxes) {
    std::vector<BlockRange> ranges;
    for (const Eigen::AlignedBox3d& box : boxes) ranges.push_back(BlocksOf(box, base.map().voxel_size));
    return StaticVoxels(base, ranges);
  };
  using Targets = std::vector<std::shared_ptr<const MatchTarget>>;
  const auto whole = std::make_shared<Targets>();
  map.match_targets = [&base, parameters, whole](
                          const FacingPoints&,
                          const std::optional<Eigen::AlignedBox3d>& within) -> absl::StatusOr<Targets> {
    if (!within && !whole->empty()) return *whole;
    const BlockRange range = within ? BlocksOf(*within, base.map().voxel_size) : base.bounds().value_or(BlockRange{});
    auto voxels = StaticVoxels(base, std::span(&range, 1));
    if (!voxels.ok()) return voxels.status();
    const FacingPoints points{std::move(voxels->points), std::move(voxels->normals)};
    Targets targets;
    for (const double voxel : kMatchVoxels) {
      targets.push_back(std::make_shared<const MatchTarget>(FeaturesOf(points, voxel, parameters)));
    }
    if (!within) *whole = targets;
    return targets;
  };
  return map;
}

}  // namespace mapkeep
