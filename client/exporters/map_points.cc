#include "client/exporters/map_points.h"

namespace mapkeep {

void ForEachPoint(const Block& block, double voxel_size, PointDetail detail,
                  const std::optional<Eigen::AlignedBox3d>& box,
                  const std::function<void(const Eigen::Vector3d& point, const Voxel& voxel)>& point) {
  const auto add = [&](const Eigen::Vector3d& position, const Voxel& voxel) {
    const bool inside = !box.has_value() || ((position.array() >= box->min().array()).all() &&
                                             (position.array() < box->max().array()).all());
    if (inside) point(position, voxel);
  };
  for (const Voxel& voxel : block.voxels) {
    if (detail == PointDetail::kCentroids) {
      add(MeanOf(block, voxel, voxel_size), voxel);
      continue;
    }
    for (const Eigen::Vector3d& position : SubVoxelPoints(block, voxel, voxel_size)) add(position, voxel);
  }
}

}  // namespace mapkeep
