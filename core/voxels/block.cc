#include "core/voxels/block.h"

#include <algorithm>
#include <bit>

namespace mapkeep {

const Voxel* FindVoxel(const Block& block, uint16_t position) {
  const auto found = std::ranges::lower_bound(block.voxels, position, {}, &Voxel::position);
  return found != block.voxels.end() && found->position == position ? &*found : nullptr;
}

Eigen::Vector3d MeanOf(const Block& block, const Voxel& voxel, double voxel_size) {
  const Eigen::Vector3d inside(voxel.mean[0] + 0.5, voxel.mean[1] + 0.5, voxel.mean[2] + 0.5);
  return CornerOf(VoxelIndexOf(VoxelKeyOf(block.key, voxel.position)), voxel_size) + inside * (voxel_size / 256);
}

std::vector<Eigen::Vector3d> SubVoxelPoints(const Block& block, const Voxel& voxel, double voxel_size) {
  const Eigen::Vector3d corner = CornerOf(VoxelIndexOf(VoxelKeyOf(block.key, voxel.position)), voxel_size);
  std::vector<Eigen::Vector3d> points;
  points.reserve(std::popcount(voxel.mask));
  for (uint64_t rest = voxel.mask; rest != 0; rest &= rest - 1) {
    const int bit = std::countr_zero(rest);
    const Eigen::Vector3d cell(bit % 4 + 0.5, bit / 4 % 4 + 0.5, bit / 16 + 0.5);
    points.push_back(corner + cell * (voxel_size / 4));
  }
  return points;
}

}  // namespace mapkeep
