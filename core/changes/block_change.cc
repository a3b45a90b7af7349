#include "core/changes/block_change.h"

namespace mapkeep {
namespace {

const Voxel* StandingAt(const Block* block, uint16_t position) {
  const Voxel* voxel = block == nullptr ? nullptr : FindVoxel(*block, position);
  return voxel != nullptr && Stands(*voxel) ? voxel : nullptr;
}

double StabilityOf(const Voxel& voxel, const ChangeParameters& parameters) {
  return Stability(voxel.hits, voxel.exposures, kCountScale * parameters.eta);
}

bool IsUnstable(const Voxel& before, const Voxel& after, const ChangeParameters& parameters) {
  if (before.ground || after.ground) return false;
  const double now = StabilityOf(after, parameters);
  return now <= parameters.highest_unstable && StabilityOf(before, parameters) - now >= parameters.least_fall;
}

}  // namespace

BlockChange CompareBlocks(BlockKey key, const Block* before, const Block* after, const ChangeParameters& parameters) {
  BlockChange change{{key, {}}, {key, {}}, {key, {}}};
  if (after != nullptr) {
    for (const Voxel& voxel : after->voxels) {
      if (!Stands(voxel)) continue;
      const Voxel* earlier = StandingAt(before, voxel.position);
      if (earlier == nullptr) {
        change.appeared.voxels.push_back(voxel);
      } else if (IsUnstable(*earlier, voxel, parameters)) {
        change.unstable.voxels.push_back(voxel);
      }
    }
  }
  if (before != nullptr) {
    for (const Voxel& voxel : before->voxels) {
      if (Stands(voxel) && StandingAt(after, voxel.position) == nullptr) change.disappeared.voxels.push_back(voxel);
    }
  }
  return change;
}

}  // namespace mapkeep
