#include "core/dor/transients.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/dor/near_voxels.h"

namespace mapkeep {
namespace {

constexpr double kCell = 0.2;       // metres: voxels that are smaller are taken together
constexpr double kMinRadius = 1.5;  // cell edges

// What is known of the voxels of a cell.
struct Cell {
  uint32_t first = std::numeric_limits<uint32_t>::max(), last = 0;  // scans that hit one
  uint32_t voxels = 0, clear = 0;

  void Add(const Cell& other) {
    first = std::min(first, other.first);
    last = std::max(last, other.last);
    voxels += other.voxels;
    clear += other.clear;
  }

  bool IsTransient(const TransientParameters& parameters) const {
    if (clear == 0 || last - first >= static_cast<uint32_t>(parameters.most_scans)) return false;
    return clear >= parameters.clear_share * voxels * (last - first + 1);
  }
};

}  // namespace

std::vector<char> FindTransients(const VoxelGrid& grid, std::span<const VoxelIndex> indices, const VoxelCounts& counts,
                                 std::span<const char> is_part, std::span<const char> candidates,
                                 const TransientParameters& parameters) {
  const auto size = static_cast<uint32_t>(indices.size());
  std::vector<char> found(size);
  if (!counts.ordered) return found;
  const int edge = std::max(1, static_cast<int>(std::lround(kCell / parameters.voxel_size)));
  const double radius = std::max(kMinRadius, parameters.reach / (edge * parameters.voxel_size));  // cell edges
  const auto cell_at = [edge](const VoxelIndex& voxel) {
    const auto at = [edge](int32_t c) { return c >= 0 ? c / edge : -((edge - 1 - c) / edge); };
    return VoxelIndex{at(voxel.x), at(voxel.y), at(voxel.z)};
  };

  // Voxels that are not smaller are the cells.
  VoxelGrid own_cells;
  if (edge > 1) {
    for (uint32_t id = 0; id < size; ++id) {
      if (is_part[id]) own_cells.Insert(cell_at(indices[id]));
    }
    own_cells.Finish();
  }
  const VoxelGrid& cells = edge > 1 ? own_cells : grid;
  const auto cell_of = [&](uint32_t id) { return edge > 1 ? own_cells.Find(cell_at(indices[id])) : id; };
  std::vector<Cell> sums(cells.size());
  NearVoxels clear(radius);  // where nothing was ever clear nobody needs to look closer
  for (uint32_t id = 0; id < size; ++id) {
    if (!is_part[id]) continue;
    sums[cell_of(id)].Add({counts.first_hit[id], counts.last_hit[id], 1, counts.clear[id]});
    if (counts.clear[id] > 0) clear.Insert(cell_at(indices[id]));
  }
  clear.Finish();

  std::vector<char> transient(cells.size());
  tbb::parallel_for(
      tbb::blocked_range<int32_t>(0, static_cast<int32_t>(cells.brick_count()), 16), [&](const auto& range) {
        for (int32_t brick = range.begin(); brick != range.end(); ++brick) {
          cells.ForEachInBrick(brick, [&](uint32_t id, const VoxelIndex& at) {
            const Cell& own = sums[id];
            if (own.voxels == 0 || own.last - own.first >= static_cast<uint32_t>(parameters.most_scans) ||
                !clear.AnyNear(at)) {
              return;
            }
            Cell place;
            cells.ForEachInBall(radius, at, [&](uint32_t other, int, int, int) { place.Add(sums[other]); });
            transient[id] = place.IsTransient(parameters);
          });
        }
      });
  for (uint32_t id = 0; id < size; ++id) found[id] = candidates[id] && transient[cell_of(id)];
  return found;
}

}  // namespace mapkeep
