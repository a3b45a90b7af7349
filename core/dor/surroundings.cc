#include "core/dor/surroundings.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace mapkeep {
namespace {

constexpr double kCell = 0.2;  // metres
constexpr int kReach = 2;      // cells

EvidenceAround EvidenceOf(const VoxelCounts& counts, uint32_t id, double unsteady_below) {
  EvidenceAround evidence{.voxels = 1, .voids = counts.confirmed[id] > 0 ? uint64_t{1} : 0};
  evidence.hits = counts.hits[id];
  evidence.exposures = counts.exposures[id];
  if (counts.hits[id] < unsteady_below * (counts.hits[id] + counts.exposures[id])) {
    evidence.unsteady_hits = counts.hits[id];
    // Without the order of the scans nobody knows what came after what.
    evidence.unsteady_returns = counts.ordered ? counts.returns[id] : 0;
  }
  return evidence;
}

}  // namespace

Surroundings::Surroundings(const VoxelGrid& grid, const VoxelCounts& counts, double voxel_size, double unsteady_below,
                           std::function<bool(uint32_t id)> is_part)
    : grid_(grid),
      counts_(counts),
      unsteady_below_(unsteady_below),
      is_part_(std::move(is_part)),
      edge_(std::max(1, static_cast<int>(std::lround(kCell / voxel_size)))) {
  if (edge_ > 1) SumCells();
}

void Surroundings::SumCells() {
  const auto for_each = [&](const auto& visit) {
    for (size_t brick = 0; brick < grid_.brick_count(); ++brick) {
      grid_.ForEachInBrick(static_cast<int32_t>(brick), [&](uint32_t id, const VoxelIndex& voxel) {
        if (is_part_(id)) visit(id, CellOf(voxel));
      });
    }
  };
  // Voxels that follow each other mostly share a cell.
  std::optional<VoxelIndex> last;
  for_each([&](uint32_t, const VoxelIndex& cell) {
    if (last != cell) cells_.Insert(cell);
    last = cell;
  });
  cells_.Finish();
  sums_.resize(cells_.size());
  last.reset();
  uint32_t at = 0;
  for_each([&](uint32_t id, const VoxelIndex& cell) {
    if (last != cell) at = cells_.Find(cell);
    last = cell;
    sums_[at].Add(EvidenceOf(counts_, id, unsteady_below_));
  });
}

VoxelIndex Surroundings::CellOf(const VoxelIndex& voxel) const {
  const auto at = [&](int32_t c) { return c >= 0 ? c / edge_ : -((edge_ - 1 - c) / edge_); };
  return {at(voxel.x), at(voxel.y), at(voxel.z)};
}

EvidenceAround Surroundings::Around(const VoxelIndex& voxel) const {
  EvidenceAround sum;
  if (edge_ > 1) {
    cells_.ForEachWithin(kReach, CellOf(voxel), [&](uint32_t cell, int, int, int) { sum.Add(sums_[cell]); });
  } else {
    grid_.ForEachWithin(kReach, voxel, [&](uint32_t id, int, int, int) {
      if (is_part_(id)) sum.Add(EvidenceOf(counts_, id, unsteady_below_));
    });
  }
  return sum;
}

}  // namespace mapkeep
