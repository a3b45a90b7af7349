#include "core/ratio_map/probation.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "core/ratio_map/neighbourhood.h"

namespace mapkeep {
namespace {

constexpr int kCellBits = 3;   // of the edge of a cell: 8 voxels
constexpr int kFollowed = 12;  // voxels around the block as far as widths are followed
constexpr double kKerb = 0.4;  // metres of ground on ground
constexpr int kFirmScans = 3;  // that ground was met by
constexpr uint32_t kNever = std::numeric_limits<uint32_t>::max();

// What one session alone met.
bool MayWait(const Voxel& voxel) { return voxel.first_seen == voxel.last_seen; }

int VoxelsOf(double metres, const MapFilterParameters& parameters) {
  return std::min(static_cast<int>(std::ceil(metres / parameters.voxel_size - 1e-9)), kBlockSize);
}

// When something was first met: what of the ground, what of all that stands on it, and what at all, in cells.
class Known {
 public:
  Known(const BlockNeighbourhood& blocks, const MapFilterParameters& parameters)
      : depth_(std::max(VoxelsOf(parameters.probation_height, parameters), VoxelsOf(kKerb, parameters))),
        ground_({0, 0, -depth_}, {kBlockSize, kBlockSize, kBlockSize}, kNever),
        standing_(kStanding, kNever),
        firm_(kStanding),
        cells_({-1, -1, -1}, {kCells, kCells, kCells}, kNever) {
    ForEachWithin(blocks, std::max(kStanding, depth_), [&](const Voxel& voxel, const VoxelIndex& at, bool) {
      if (cells_.Has(CellOf(at))) {
        uint32_t& cell = cells_[CellOf(at)];
        cell = std::min(cell, voxel.first_seen);
      }
      if (voxel.ground) {
        if (ground_.Has(at) && voxel.hits >= kFirmScans * kCountScale) ground_[at] = voxel.first_seen;
      } else if (standing_.Has(at) && Stability(voxel.hits, voxel.exposures, kCountScale * parameters.eta) >=
                                          parameters.stability_threshold) {
        standing_[at] = voxel.first_seen;
        firm_[at] = voxel.hits >= 2 * parameters.probation_hits * kCountScale;
      }
    });
  }

  // Whether ground at most `depth` voxels below was known before `time`: whoever met it looked over it.
  bool HasGroundBelow(const VoxelIndex& voxel, int depth, uint32_t time) const {
    for (int z = voxel.z - 1; z >= voxel.z - depth; --z) {
      if (ground_[{voxel.x, voxel.y, z}] < time) return true;
    }
    return false;
  }

  // Whether a neighbour was known before `time`: then the voxel is more of that.
  bool HasNeighbour(const VoxelIndex& voxel, uint32_t time) const {
    return AnyAround(voxel, [&](const VoxelIndex& at) { return standing_[at] < time; });
  }

  // Whether a neighbour, however new, was met by twice as many scans as what waits for its few: it is more of that.
  bool HasFirmNeighbour(const VoxelIndex& voxel) const {
    return AnyAround(voxel, [&](const VoxelIndex& at) { return firm_[at] != 0; });
  }

  // Whether anything near was known before `time`: the map reached this far.
  bool HasMap(const VoxelIndex& voxel, uint32_t time) const {
    return AnyAround(CellOf(voxel), [&](const VoxelIndex& cell) { return cells_[cell] < time; });
  }

 private:
  static constexpr int kStanding = kFollowed + 1;  // voxels around the block, for the neighbours of what is followed
  static constexpr int kCells = (kBlockSize >> kCellBits) + 1;

  template <typename Is>
  static bool AnyAround(const VoxelIndex& at, const Is& is) {
    bool any = false;
    ForEachBeside(at, 1, [&](const VoxelIndex& beside) { any = any || is(beside); });
    return any;
  }

  static VoxelIndex CellOf(const VoxelIndex& at) { return {at.x >> kCellBits, at.y >> kCellBits, at.z >> kCellBits}; }

  const int depth_;
  ValuesAround<uint32_t> ground_, standing_;
  ValuesAround<uint8_t> firm_;
  ValuesAround<uint32_t> cells_;
};

// What one session alone met in the block and around it and touches nothing that was known, and how wide it is as far
// as it hangs together: a person beside a wall is no wider for it.
class NewThings {
 public:
  NewThings(const BlockNeighbourhood& blocks, const Known& known) : things_(kFollowed, kNone) {
    std::vector<VoxelIndex> open;
    ForEachWithin(blocks, kFollowed, [&](const Voxel& voxel, const VoxelIndex& at, bool) {
      if (voxel.ground || !MayWait(voxel) || known.HasNeighbour(at, voxel.first_seen)) return;
      things_[at] = kUnknown;
      open.push_back(at);
    });
    for (const VoxelIndex& at : open) {
      if (things_[at] == kUnknown) Follow(at);
    }
  }

  // Voxels from one side to the other, the larger of x and y.
  int WidthAt(const VoxelIndex& voxel) const { return widths_[static_cast<size_t>(things_[voxel])]; }

 private:
  static constexpr int32_t kNone = -1, kUnknown = -2;

  // Neighbours of neighbours hang together: a car far away is lines with gaps.
  void Follow(const VoxelIndex& start) {
    constexpr int kGap = 2;
    const auto thing = static_cast<int32_t>(widths_.size());
    VoxelIndex low = start, high = start;
    std::vector<VoxelIndex> reached = {start};
    things_[start] = thing;
    while (!reached.empty()) {
      const VoxelIndex at = reached.back();
      reached.pop_back();
      low = {std::min(low.x, at.x), std::min(low.y, at.y), 0};
      high = {std::max(high.x, at.x), std::max(high.y, at.y), 0};
      ForEachBeside(at, kGap, [&](const VoxelIndex& beside) {
        if (!things_.Has(beside) || things_[beside] != kUnknown) return;
        things_[beside] = thing;
        reached.push_back(beside);
      });
    }
    widths_.push_back(std::max(high.x - low.x, high.y - low.y) + 1);
  }

  ValuesAround<int32_t> things_;  // of each voxel
  std::vector<int> widths_;       // of each thing
};

}  // namespace

std::vector<bool> Waiting(const BlockNeighbourhood& blocks, const MapFilterParameters& parameters) {
  if (parameters.probation_height <= 0 || std::ranges::none_of(blocks[kCentre]->voxels, MayWait)) return {};
  const Known known(blocks, parameters);
  const int height = VoxelsOf(parameters.probation_height, parameters), kerb = VoxelsOf(kKerb, parameters);
  std::optional<NewThings> things;
  const auto is_narrow = [&](const VoxelIndex& at) {
    if (parameters.probation_width <= 0) return true;
    if (!things) things.emplace(blocks, known);
    return things->WidthAt(at) * parameters.voxel_size <= parameters.probation_width + 1e-9;
  };
  std::vector<bool> waiting;
  waiting.reserve(blocks[kCentre]->voxels.size());
  for (const Voxel& voxel : blocks[kCentre]->voxels) {
    const VoxelIndex at = IndexIn(voxel.position);
    const uint32_t time = voxel.first_seen;
    const auto waits = [&] {
      if (!MayWait(voxel)) return false;
      if (voxel.ground) return known.HasGroundBelow(at, kerb, time);
      if (known.HasNeighbour(at, time)) return false;
      const bool few = voxel.hits <= parameters.probation_hits * kCountScale && !known.HasFirmNeighbour(at);
      if (few && known.HasMap(at, time)) return true;
      return known.HasGroundBelow(at, height, time) && is_narrow(at);
    };
    waiting.push_back(waits());
  }
  return waiting;
}

}  // namespace mapkeep
