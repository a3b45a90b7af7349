#include "core/tiling/tile_point.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace mapkeep {
namespace {

constexpr uint32_t kMinutesADay = 24 * 60;

}  // namespace

void AppendPoints(const Block& block, const PointSelection& selection, std::vector<TilePoint>& points) {
  const VoxelIndex corner = BlockIndexOf(block.key);
  constexpr int kMask = kBlockSize - 1;
  for (const Voxel& voxel : block.voxels) {
    if (selection.static_only && !voxel.is_static) continue;
    TilePoint point{.normal = voxel.normal, .intensity = voxel.intensity, .ground = voxel.ground};
    const double stability = Stability(voxel.hits, voxel.exposures, selection.eta * kCountScale);
    point.stability = static_cast<uint8_t>(std::lround(255 * stability));
    point.first_seen_day = static_cast<uint16_t>(std::min<uint32_t>(voxel.first_seen / kMinutesADay, UINT16_MAX));
    const int32_t x = (corner.x * kBlockSize + (voxel.position & kMask)) * 4;
    const int32_t y = (corner.y * kBlockSize + (voxel.position >> kBlockBits & kMask)) * 4;
    const int32_t z = (corner.z * kBlockSize + (voxel.position >> (2 * kBlockBits))) * 4;
    for (uint64_t rest = voxel.mask; rest != 0; rest &= rest - 1) {
      const int bit = std::countr_zero(rest);
      point.x = x + bit % 4;
      point.y = y + bit / 4 % 4;
      point.z = z + bit / 16;
      points.push_back(point);
    }
  }
}

}  // namespace mapkeep
