#include "core/dor/departures.h"

#include <absl/container/flat_hash_map.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "core/dor/near_voxels.h"

namespace mapkeep {
namespace {

constexpr double kNear = 0.58;          // metres: how far the neighbours of a voxel reach, at least kNearVoxels
constexpr double kNearVoxels = 2.9;     // voxel edges
constexpr int kSlack = 5;               // scans by which the voxels of an object may be left one after the other
constexpr int kPersists = 10;           // scans after the departure: what is hit even later stands there still
constexpr double kMaxPersisting = 0.3;  // share of the voxels around that may
constexpr double kMinGone = 0.3;       // share of the voxels around that left, for one that nobody looked through since
constexpr int kRounds = 12;            // in which such voxels follow one another
constexpr int kMinWitnesses = 3;       // vacated voxels that must speak for another one
constexpr double kMinOrdered = 0.8;    // share of a vacated voxel's exposures that come after its last hit
constexpr uint32_t kMinHits = 3;       // of a vacated voxel
constexpr uint32_t kMinConfirmed = 2;  // scans that make a confirmed void of one

// What sets out beside a voxel that is left.
constexpr double kBeside = 0.8;         // metres
constexpr int kSetsOutBefore = 8;       // scans before the last hit
constexpr int kSetsOutAfter = 20;       // and after it, in which it is first seen there
constexpr int kMinSettingOut = 4;       // voxels
constexpr double kMinSteadiness = 0.8;  // share of the scans between first and last hit that hit the voxel

// Why a voxel may have been vacated.
constexpr char kFree = 1, kConfirmed = 2;
constexpr char kGrazed = 4;  // and why not

// One direction of time. An arrival is a departure seen backwards.
class Departures {
 public:
  Departures(const VoxelGrid& grid, const DepartureEvidence& evidence, const DepartureParameters& parameters,
             std::vector<int32_t> first, std::vector<int32_t> last, std::vector<int32_t> free)
      : grid_(grid),
        indices_(evidence.indices),
        candidates_(evidence.candidates),
        is_dynamic_(evidence.is_dynamic),
        is_grazed_(evidence.is_grazed),
        parameters_(parameters),
        first_(std::move(first)),
        last_(std::move(last)),
        free_(std::move(free)),
        near_(std::max(kNearVoxels, kNear / parameters.voxel_size)) {}

  // `free_scans`: by id, how many scans looked through a voxel after it was left; `confirmed_scans`: how many of those
  // confirmed the void.
  void Mark(const std::vector<uint32_t>& free_scans, const std::vector<uint32_t>& confirmed_scans,
            const VoxelCounts& counts, std::vector<char>& departed) {
    FindVacated(free_scans, confirmed_scans, counts);
    if (vacated_.empty()) return;
    const auto vacated_around = VacatedByCell();
    free_since_.resize(indices_.size());
    for (uint32_t id = 0; id < indices_.size(); ++id) {
      free_since_[id] = free_scans[id] > 0 && free_scans[id] >= kMinOrdered * counts.exposures[id];
    }
    std::vector<char> may_have_left(indices_.size());
    tbb::parallel_for(tbb::blocked_range<uint32_t>(0, static_cast<uint32_t>(indices_.size()), 1024),
                      [&](const auto& range) {
                        std::vector<int32_t> times;
                        for (uint32_t id = range.begin(); id != range.end(); ++id) {
                          if (!candidates_[id]) continue;
                          const auto around = vacated_around.find(CellOf(indices_[id]));
                          if (around != vacated_around.end()) may_have_left[id] = LeftWith(id, around->second, times);
                        }
                      });
    std::vector<uint32_t> hidden;
    for (uint32_t id = 0; id < indices_.size(); ++id) {
      if (!may_have_left[id]) continue;
      if (free_since_[id]) {
        departed[id] = 1;
      } else {
        hidden.push_back(id);
      }
    }
    MarkHidden(hidden, departed);
  }

 private:
  using Cell = std::array<int32_t, 3>;

  // Densely and at the same time, and near a confirmed void or where something set out: what is looked through here and
  // there does not count.
  void FindVacated(const std::vector<uint32_t>& free_scans, const std::vector<uint32_t>& confirmed_scans,
                   const VoxelCounts& counts) {
    std::vector<char> kinds(indices_.size());
    std::vector<uint32_t> free;
    NearVoxels confirmed(parameters_.confirm_reach / parameters_.voxel_size);
    for (uint32_t id = 0; id < indices_.size(); ++id) {
      if (!candidates_[id] || counts.hits[id] < kMinHits) continue;
      if (confirmed_scans[id] > 0 && confirmed_scans[id] >= kMinOrdered * counts.confirmed[id]) {
        confirmed.Insert(indices_[id]);
        if (confirmed_scans[id] >= kMinConfirmed) kinds[id] |= kConfirmed;
      }
      if (free_scans[id] >= static_cast<uint32_t>(parameters_.vacated_scans) &&
          free_scans[id] >= kMinOrdered * counts.exposures[id]) {
        kinds[id] |= kFree;
      }
      if (kinds[id] == 0) continue;
      free.push_back(id);
    }
    confirmed.Finish();
    tbb::parallel_for(tbb::blocked_range<size_t>(0, free.size(), 256), [&](const auto& range) {
      for (size_t i = range.begin(); i != range.end(); ++i) {
        if (is_grazed_(free[i], static_cast<uint32_t>(std::abs(free_[free[i]])))) kinds[free[i]] |= kGrazed;
      }
    });
    std::vector<char> is_vacated(free.size());
    tbb::parallel_for(tbb::blocked_range<size_t>(0, free.size(), 256), [&](const auto& range) {
      for (size_t i = range.begin(); i != range.end(); ++i) {
        const char kind = kinds[free[i]];
        const bool is_void =
            confirmed.AnyNear(indices_[free[i]]) && ((kind & kGrazed) == 0 || (kind & kConfirmed) != 0);
        if (!is_void && !IsLeftBySomething(free[i], free_scans[free[i]], counts)) continue;
        int together = 0, together_confirmed = 0;
        ForEachNear(free[i], [&](uint32_t other) {
          if (std::abs(last_[other] - last_[free[i]]) > kSlack) return;
          together += (kinds[other] & kFree) != 0 && !(is_void && (kinds[other] & kGrazed) != 0);
          together_confirmed += (kinds[other] & kConfirmed) != 0;
        });
        is_vacated[i] = ((kind & kFree) != 0 && together >= parameters_.vacated_neighbours) ||
                        ((kind & kConfirmed) != 0 && together_confirmed >= parameters_.confirmed_neighbours);
      }
    });
    for (size_t i = 0; i < free.size(); ++i) {
      if (is_vacated[i]) vacated_.push_back(free[i]);
    }
  }

  // Whether a voxel was hit all the time, and something was first seen beside it when that ended.
  bool IsLeftBySomething(uint32_t id, uint32_t free_scans, const VoxelCounts& counts) const {
    if (counts.hits[id] < kMinSteadiness * (last_[id] - first_[id] + 1) || free_scans < counts.exposures[id])
      return false;
    int setting_out = 0;
    const int reach = static_cast<int>(std::ceil(kBeside / parameters_.voxel_size));
    grid_.ForEachWithin(reach, indices_[id], [&](uint32_t other, int, int, int) {
      if (!is_dynamic_[other]) return;
      const int32_t since = first_[other] - last_[id];
      setting_out += since >= -kSetsOutBefore && since <= kSetsOutAfter;
    });
    return setting_out >= kMinSettingOut;
  }

  Cell CellOf(const VoxelIndex& voxel) const {
    const double edge = parameters_.reach / parameters_.voxel_size;
    return {static_cast<int32_t>(std::floor(voxel.x / edge)), static_cast<int32_t>(std::floor(voxel.y / edge)),
            static_cast<int32_t>(std::floor(voxel.z / edge))};
  }

  // Vacated voxels under the cell that they lie in and the 26 around, so that one look finds all that may be in reach.
  absl::flat_hash_map<Cell, std::vector<uint32_t>> VacatedByCell() const {
    absl::flat_hash_map<Cell, std::vector<uint32_t>> cells;
    for (const uint32_t id : vacated_) {
      const Cell cell = CellOf(indices_[id]);
      for (int dz = -1; dz <= 1; ++dz) {
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) cells[{cell[0] + dx, cell[1] + dy, cell[2] + dz}].push_back(id);
        }
      }
    }
    return cells;
  }

  // Whether a voxel was left when vacated ones around it were, and nothing beside it stayed. What was itself looked
  // through since may have been left at any time until the others were free; of what was not, only what was last seen
  // with them is theirs: nobody may have looked there again.
  bool LeftWith(uint32_t id, const std::vector<uint32_t>& around, std::vector<int32_t>& times) const {
    const double reach = parameters_.reach / parameters_.voxel_size;
    times.clear();
    for (const uint32_t other : around) {
      if (last_[id] <= free_[other] + kSlack && SquaredDistance(id, other) <= reach * reach) {
        times.push_back(free_since_[id] ? free_[other] : last_[other]);
      }
    }
    if (times.size() < kMinWitnesses) return false;
    const auto median = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
    std::ranges::nth_element(times, median);
    int all = 0, persisting = 0;
    ForEachNear(id, [&](uint32_t other) {
      if (!candidates_[other]) return;
      ++all;
      persisting += last_[other] > *median + kPersists && !(free_since_[id] && free_since_[other]);
    });
    return persisting <= kMaxPersisting * all;
  }

  // What may have left but was not looked through since: the far side of a car, and the hedge behind it. It left if
  // enough around it did, from the outside inwards.
  void MarkHidden(const std::vector<uint32_t>& hidden, std::vector<char>& departed) const {
    std::vector<int32_t> missing(indices_.size());  // of hidden ones: voxels around that must leave before it does
    std::vector<char> waits(indices_.size());
    tbb::parallel_for(tbb::blocked_range<size_t>(0, hidden.size(), 256), [&](const auto& range) {
      for (size_t i = range.begin(); i != range.end(); ++i) {
        int all = 0, gone = 0;
        ForEachNear(hidden[i], [&](uint32_t other) {
          if (!candidates_[other]) return;
          ++all;
          gone += free_since_[other];
        });
        missing[hidden[i]] = static_cast<int32_t>(std::ceil(kMinGone * all)) - gone;
        waits[hidden[i]] = 1;
      }
    });
    std::vector<uint32_t> leaving;
    std::ranges::copy_if(hidden, std::back_inserter(leaving), [&](uint32_t id) { return missing[id] <= 0; });
    for (int round = 0; round < kRounds && !leaving.empty(); ++round) {
      for (const uint32_t id : leaving) {
        departed[id] = 1;
        waits[id] = 0;
      }
      std::vector<uint32_t> next;
      for (const uint32_t id : leaving) {
        ForEachNear(id, [&](uint32_t other) {
          if (waits[other] && --missing[other] == 0) next.push_back(other);
        });
      }
      leaving = std::move(next);
    }
  }

  double SquaredDistance(uint32_t a, uint32_t b) const {
    const double x = indices_[a].x - indices_[b].x, y = indices_[a].y - indices_[b].y,
                 z = indices_[a].z - indices_[b].z;
    return x * x + y * y + z * z;
  }

  // Calls visit(id) for the voxels near one, itself included.
  template <typename Visit>
  void ForEachNear(uint32_t id, const Visit& visit) const {
    grid_.ForEachInBall(near_, indices_[id], [&](uint32_t other, int, int, int) { visit(other); });
  }

  const VoxelGrid& grid_;
  std::span<const VoxelIndex> indices_;
  std::span<const char> candidates_, is_dynamic_;
  const std::function<bool(uint32_t, uint32_t)>& is_grazed_;
  const DepartureParameters& parameters_;
  const std::vector<int32_t> first_;  // by id: the scan of the first hit
  const std::vector<int32_t> last_;   // and of the last
  const std::vector<int32_t> free_;   // of vacated voxels: the scan that first looked through it then
  const double near_;                 // voxel edges
  std::vector<uint32_t> vacated_;
  std::vector<char> free_since_;  // by id: whether nearly all that looked through it did so after its last hit
};

}  // namespace

std::vector<char> FindDepartures(const VoxelGrid& grid, const VoxelCounts& counts, const DepartureEvidence& evidence,
                                 const DepartureParameters& parameters) {
  std::vector<char> departed(grid.size());
  if (!counts.ordered) return departed;
  const auto in_time = [&](const std::vector<uint32_t>& scans, int32_t direction) {
    std::vector<int32_t> times(scans.size());
    std::ranges::transform(scans, times.begin(), [&](uint32_t s) { return direction * static_cast<int32_t>(s); });
    return times;
  };
  std::vector<char> arrived(grid.size());
  tbb::parallel_invoke(
      [&] {
        Departures(grid, evidence, parameters, in_time(counts.first_hit, 1), in_time(counts.last_hit, 1),
                   in_time(counts.free_from, 1))
            .Mark(counts.late, counts.confirmed_late, counts, departed);
      },
      [&] {
        Departures(grid, evidence, parameters, in_time(counts.last_hit, -1), in_time(counts.first_hit, -1),
                   in_time(counts.free_until, -1))
            .Mark(counts.early, counts.confirmed_early, counts, arrived);
      });
  for (size_t id = 0; id < departed.size(); ++id) departed[id] |= arrived[id];
  return departed;
}

}  // namespace mapkeep
