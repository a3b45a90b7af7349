#include "core/ratio_map/enclosure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "core/ratio_map/neighbourhood.h"

namespace mapkeep {
namespace {

constexpr int kFirmScans = 5;  // that what encloses was met by
// Of four.
constexpr int kSides = 2;
constexpr int kSidesOfSeenThrough = 1;  // of what was looked through at all

// When what stands in the block and `reach` voxels around it in its layers came.
class Arrivals {
 public:
  Arrivals(const BlockNeighbourhood& blocks, int reach, const MapFilterParameters& parameters)
      : reach_(reach), first_seen_({-reach, -reach, 0}, {kBlockSize + reach, kBlockSize + reach, kBlockSize}) {
    ForEachWithin(blocks, reach, [&](const Voxel& voxel, const VoxelIndex& at, bool) {
      if (voxel.ground || !IsWithin(at.z, 0) || voxel.hits < kFirmScans * kCountScale) return;
      if (Stability(voxel.hits, voxel.exposures, kCountScale * parameters.eta) < parameters.stability_threshold) return;
      first_seen_[at] = voxel.first_seen;
      latest_ = std::max(latest_, voxel.first_seen);
    });
  }

  uint32_t latest() const { return latest_; }

  // On how many of four sides something stands that came after `time`.
  int SidesAfter(const VoxelIndex& voxel, uint32_t time) const {
    constexpr std::array<std::array<int, 2>, 4> kSteps = {{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
    int sides = 0;
    for (const auto& [dx, dy] : kSteps) {
      bool found = false;
      for (int i = 1; i <= reach_ && !found; ++i) {
        found = first_seen_[{voxel.x + i * dx, voxel.y + i * dy, voxel.z}] > time;
      }
      sides += found ? 1 : 0;
    }
    return sides;
  }

 private:
  const int reach_;
  ValuesAround<uint32_t> first_seen_;  // 0: nothing stands there
  uint32_t latest_ = 0;
};

}  // namespace

std::vector<bool> Enclosed(const BlockNeighbourhood& blocks, const MapFilterParameters& parameters) {
  const int reach =
      std::min(static_cast<int>(std::lround(parameters.enclosure_reach / parameters.voxel_size)), kBlockSize);
  if (reach <= 0) return {};
  const std::vector<Voxel>& voxels = blocks[kCentre]->voxels;
  const Arrivals arrivals(blocks, reach, parameters);
  const auto may_be = [&](const Voxel& voxel) { return voxel.last_seen < arrivals.latest(); };
  if (std::ranges::none_of(voxels, may_be)) return {};
  std::vector<bool> enclosed;
  enclosed.reserve(voxels.size());
  for (const Voxel& voxel : voxels) {
    const int sides = voxel.exposures >= kCountScale ? kSidesOfSeenThrough : kSides;
    enclosed.push_back(may_be(voxel) && arrivals.SidesAfter(IndexIn(voxel.position), voxel.last_seen) >= sides);
  }
  return enclosed;
}

}  // namespace mapkeep
