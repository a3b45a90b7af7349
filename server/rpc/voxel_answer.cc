#include "server/rpc/voxel_answer.h"

#include <absl/strings/str_format.h>

#include "core/voxels/block.h"
#include "server/rpc/convert.h"

namespace mapkeep {

absl::StatusOr<v1::QueryVoxelResponse> VoxelAt(const Snapshot& snapshot, const Eigen::Vector3d& point, double eta) {
  const double voxel_size = snapshot.map().voxel_size;
  const auto index = VoxelIndexOf(point, voxel_size);
  if (!index.ok()) return index.status();
  const auto block = snapshot.Read(BlockKeyOf(BlockOf(*index)));
  if (!block.ok()) return block.status();
  const Voxel* voxel = *block == nullptr ? nullptr : FindVoxel(**block, PositionInBlock(*index));
  if (voxel == nullptr) {
    return absl::NotFoundError(
        absl::StrFormat("map %s has no voxel at (%g, %g, %g)", snapshot.map().name, point.x(), point.y(), point.z()));
  }
  const double hits = static_cast<double>(voxel->hits) / kCountScale;
  const double exposures = static_cast<double>(voxel->exposures) / kCountScale;
  v1::QueryVoxelResponse answer;
  answer.set_epoch(snapshot.epoch());
  answer.set_hits(hits);
  answer.set_exposures(exposures);
  answer.set_stability(Stability(hits, exposures, eta));
  answer.set_ground(voxel->ground);
  answer.set_is_static(voxel->is_static);
  answer.set_is_new(voxel->is_new);
  answer.set_first_seen(SecondsSince1970(voxel->first_seen));
  answer.set_last_seen(SecondsSince1970(voxel->last_seen));
  *answer.mutable_mean() = ToProto(MeanOf(**block, *voxel, voxel_size));
  answer.set_intensity(voxel->intensity / 255.0);
  return answer;
}

}  // namespace mapkeep
