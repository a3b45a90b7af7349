#include "core/ratio_map/cohorts.h"

#include <algorithm>
#include <bit>

#include "core/ratio_map/neighbourhood.h"

namespace mapkeep {
namespace {

constexpr int kCellsAround = 2;  // of a cell on either side that are within reach of it
constexpr int kMinLookedThrough = 3;

// What the map and the session said of a voxel of the map.
struct Said {
  bool ground = false;  // either of them
  bool looked_through = false;
  bool met = false;
};

// What a session said of the voxels of a cell that came together.
struct Cohort {
  uint32_t first_seen = 0;
  int all = 0, looked_through = 0, met = 0;
  bool left = false;
};

// Cohorts in cells of the centre block and of kCellsAround cells around it.
class Cells {
 public:
  explicit Cells(int edge)
      : edge_bits_(std::countr_zero(static_cast<unsigned>(edge))),
        across_((kBlockSize >> edge_bits_) + 2 * kCellsAround),
        cohorts_(static_cast<size_t>(across_) * across_ * across_) {}

  // Ground belongs to a cohort and is not counted.
  void Count(const VoxelIndex& at, uint32_t first_seen, const Said& said) {
    const VoxelIndex cell = CellOf(at);
    if (!IsInside(cell)) return;
    Cohort& cohort = Find(SlotOf(cell), first_seen);
    if (said.ground) return;
    ++cohort.all;
    cohort.looked_through += said.looked_through ? 1 : 0;
    cohort.met += said.met ? 1 : 0;
  }

  // Says of every cohort of the centre block's cells whether it left.
  void Judge(const MergeParameters& parameters) {
    const int end = across_ - kCellsAround;
    for (int z = kCellsAround; z < end; ++z) {
      for (int y = kCellsAround; y < end; ++y) {
        for (int x = kCellsAround; x < end; ++x) {
          for (Cohort& cohort : cohorts_[SlotOf({x, y, z})]) {
            const Cohort sum = Around({x, y, z}, cohort.first_seen);
            cohort.left = sum.looked_through >= kMinLookedThrough &&
                          sum.looked_through >= parameters.cohort_looked_through * sum.all &&
                          sum.met <= parameters.cohort_met * sum.all;
          }
        }
      }
    }
  }

  bool Left(const VoxelIndex& at, uint32_t first_seen) { return Find(SlotOf(CellOf(at)), first_seen).left; }

 private:
  VoxelIndex CellOf(const VoxelIndex& at) const {
    return {(at.x >> edge_bits_) + kCellsAround, (at.y >> edge_bits_) + kCellsAround,
            (at.z >> edge_bits_) + kCellsAround};
  }
  bool IsInside(const VoxelIndex& cell) const {
    const auto inside = [this](int32_t c) { return c >= 0 && c < across_; };
    return inside(cell.x) && inside(cell.y) && inside(cell.z);
  }
  size_t SlotOf(const VoxelIndex& cell) const {
    return (static_cast<size_t>(cell.z) * across_ + static_cast<size_t>(cell.y)) * across_ +
           static_cast<size_t>(cell.x);
  }
  Cohort& Find(size_t slot, uint32_t first_seen) {
    const auto found = std::ranges::find(cohorts_[slot], first_seen, &Cohort::first_seen);
    return found != cohorts_[slot].end() ? *found : cohorts_[slot].emplace_back(Cohort{.first_seen = first_seen});
  }
  Cohort Around(const VoxelIndex& cell, uint32_t first_seen) const {
    Cohort sum;
    for (int z = cell.z - kCellsAround; z <= cell.z + kCellsAround; ++z) {
      for (int y = cell.y - kCellsAround; y <= cell.y + kCellsAround; ++y) {
        for (int x = cell.x - kCellsAround; x <= cell.x + kCellsAround; ++x) {
          for (const Cohort& cohort : cohorts_[SlotOf({x, y, z})]) {
            if (cohort.first_seen != first_seen) continue;
            sum.all += cohort.all;
            sum.looked_through += cohort.looked_through;
            sum.met += cohort.met;
          }
        }
      }
    }
    return sum;
  }

  const int edge_bits_;
  const int across_;
  std::vector<std::vector<Cohort>> cohorts_;  // of each cell
};

bool IsLookedThrough(const SessionVoxel& voxel) { return voxel.hits == 0 && voxel.exposures > 0; }

// Calls visit(voxel, what was said of it) for every voxel of the map's block.
template <typename Visit>
void ForEachVoxel(const Block& block, std::span<const SessionVoxel> session, const Visit& visit) {
  auto next = session.begin();
  for (const Voxel& voxel : block.voxels) {
    while (next != session.end() && PositionInBlock(next->key) < voxel.position) ++next;
    const bool found = next != session.end() && PositionInBlock(next->key) == voxel.position;
    Said said{.ground = voxel.ground};
    if (found) {
      said.met = next->hits > 0;
      said.looked_through = IsLookedThrough(*next);
      said.ground = voxel.ground || (next->ground && said.met);
    }
    visit(voxel, said);
  }
}

}  // namespace

std::vector<uint16_t> ForgottenWithCohort(const BlockNeighbourhood& map, const SessionNeighbourhood& session,
                                          double voxel_size, const MergeParameters& parameters) {
  const bool any = std::ranges::any_of(
      session, [](std::span<const SessionVoxel> voxels) { return std::ranges::any_of(voxels, IsLookedThrough); });
  if (!any || parameters.contradicting_scans == 0 || parameters.cohort_looked_through > 1 || map[kCentre] == nullptr) {
    return {};
  }
  // A power of two, so that blocks are whole cells; two of them are the margin, which one block has to hold.
  const double cell = std::clamp(parameters.cohort_reach / kCellsAround / voxel_size, 1.0, double{kBlockSize} / 2);
  Cells cells(static_cast<int>(std::bit_floor(static_cast<unsigned>(cell + 1e-9))));
  for (int i = 0; i < 27; ++i) {
    if (map[i] == nullptr) continue;
    ForEachVoxel(*map[i], session[i], [&](const Voxel& voxel, const Said& said) {
      cells.Count(IndexIn(voxel.position, i), voxel.first_seen, said);
    });
  }
  cells.Judge(parameters);
  std::vector<uint16_t> forgotten;
  ForEachVoxel(*map[kCentre], session[kCentre], [&](const Voxel& voxel, const Said& said) {
    if (!said.met && cells.Left(IndexIn(voxel.position), voxel.first_seen)) forgotten.push_back(voxel.position);
  });
  return forgotten;
}

}  // namespace mapkeep
