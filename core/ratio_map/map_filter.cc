#include "core/ratio_map/map_filter.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/dor/clusters.h"

namespace mapkeep {
namespace {

// Neighbouring voxels this far from the block's faces take part in its clusters: 1.6 m at 0.2 m, enough to tell an
// object from a stray voxel, and far less work than the whole 26 blocks.
constexpr int kMargin = 8;
constexpr int kCentre = 13;

double StabilityOf(const Voxel& voxel, const MapFilterParameters& parameters) {
  return Stability(voxel.hits, voxel.exposures, kCountScale * parameters.eta);
}

bool IsCandidate(const Voxel& voxel, const MapFilterParameters& parameters) {
  return !voxel.ground && StabilityOf(voxel, parameters) < parameters.candidate_threshold;
}

// The voxels of a block, which are sorted by position, in layers [first, last) of z.
std::span<const Voxel> Layers(const Block& block, int first, int last) {
  if (first <= 0 && last >= kBlockSize) return block.voxels;
  const auto before = [](int layer) {
    return
        [position = std::max(layer, 0) << (2 * kBlockBits)](const Voxel& voxel) { return voxel.position < position; };
  };
  const auto begin = std::ranges::partition_point(block.voxels, before(first));
  return {begin, std::ranges::partition_point(begin, block.voxels.end(), before(last))};
}

// Calls visit(voxel, coordinates from the centre block's corner) for every voxel of the neighbourhood that lies at most
// `margin` voxels outside the centre block, in a fixed order.
template <typename Visit>
void ForEachWithin(const BlockNeighbourhood& blocks, int margin, const Visit& visit) {
  for (int i = 0; i < 27; ++i) {
    if (blocks[i] == nullptr) continue;
    const VoxelIndex shift{(i % 3 - 1) * kBlockSize, (i / 3 % 3 - 1) * kBlockSize, (i / 9 - 1) * kBlockSize};
    const auto inside = [margin](int32_t c) { return c >= -margin && c < kBlockSize + margin; };
    for (const Voxel& voxel : Layers(*blocks[i], -margin - shift.z, kBlockSize + margin - shift.z)) {
      constexpr int kMask = kBlockSize - 1;
      const VoxelIndex at{shift.x + (voxel.position & kMask), shift.y + (voxel.position >> kBlockBits & kMask),
                          shift.z + (voxel.position >> (2 * kBlockBits))};
      if (inside(at.x) && inside(at.y)) visit(voxel, at, i == kCentre);
    }
  }
}

// Which voxels of the centre block and one voxel around it are occupied: a row along x is the bits of one number.
class Occupancy {
 public:
  explicit Occupancy(const BlockNeighbourhood& blocks) : rows_(kEdge * kEdge) {
    ForEachWithin(blocks, 1, [&](const Voxel&, const VoxelIndex& at, bool) {
      rows_[RowOf(at.y, at.z)] |= uint64_t{1} << (at.x + 1);
    });
  }

  int NeighboursOf(const VoxelIndex& voxel) const {
    int count = -1;  // the voxel itself
    for (int z = voxel.z - 1; z <= voxel.z + 1; ++z) {
      for (int y = voxel.y - 1; y <= voxel.y + 1; ++y) count += std::popcount(rows_[RowOf(y, z)] >> voxel.x & 7);
    }
    return count;
  }

 private:
  static constexpr size_t kEdge = kBlockSize + 2;
  static size_t RowOf(int32_t y, int32_t z) { return static_cast<size_t>(y + 1) + kEdge * static_cast<size_t>(z + 1); }

  std::vector<uint64_t> rows_;
};

// Eq. 5 over the candidates near the block: for each candidate of the centre block, in its order, whether it goes. One
// that belongs to no cluster is judged by its own R.
std::vector<bool> DynamicCandidates(const BlockNeighbourhood& blocks, const MapFilterParameters& parameters) {
  std::vector<Eigen::Vector3d> points;
  std::vector<double> stabilities;
  std::vector<uint32_t> of_centre;
  ForEachWithin(blocks, kMargin, [&](const Voxel& voxel, const VoxelIndex& at, bool centre) {
    if (!IsCandidate(voxel, parameters)) return;
    if (centre) of_centre.push_back(static_cast<uint32_t>(points.size()));
    const Eigen::Vector3d inside(voxel.mean[0] + 0.5, voxel.mean[1] + 0.5, voxel.mean[2] + 0.5);
    points.push_back((Eigen::Vector3d(at.x, at.y, at.z) + inside / 256) * parameters.voxel_size);
    stabilities.push_back(StabilityOf(voxel, parameters));
  });
  const Clusters clusters = ClusterPoints(points, parameters.cluster_radius, parameters.cluster_min_neighbours);
  std::vector<double> sums(clusters.count);
  std::vector<int> counts(clusters.count);
  for (size_t i = 0; i < points.size(); ++i) {
    if (clusters.ids[i] == kNoise) continue;
    sums[clusters.ids[i]] += stabilities[i];
    ++counts[clusters.ids[i]];
  }
  std::vector<bool> dynamic;
  dynamic.reserve(of_centre.size());
  for (const uint32_t i : of_centre) {
    const int32_t id = clusters.ids[i];
    dynamic.push_back(id == kNoise ? stabilities[i] < parameters.stability_threshold
                                   : sums[id] / counts[id] < parameters.cluster_threshold);
  }
  return dynamic;
}

// Where earlier sessions had met something: what of the ground, and what of all that stands on it.
class Known {
 public:
  Known(const BlockNeighbourhood& blocks, const MapFilterParameters& parameters)
      : depth_(std::min(static_cast<int>(std::ceil(parameters.probation_height / parameters.voxel_size)), kBlockSize)),
        ground_(static_cast<size_t>(kBlockSize) * kBlockSize * (kBlockSize + depth_), kNever),
        standing_(static_cast<size_t>(kEdge) * kEdge * kEdge, kNever) {
    ForEachWithin(blocks, std::max(1, depth_), [&](const Voxel& voxel, const VoxelIndex& at, bool) {
      if (voxel.ground) {
        if (IsIn(at.x, 0) && IsIn(at.y, 0) && at.z < kBlockSize && voxel.hits >= kFirmHits) {
          ground_[GroundSlot(at.x, at.y, at.z)] = voxel.first_seen;
        }
      } else if (IsIn(at.x, 1) && IsIn(at.y, 1) && IsIn(at.z, 1) &&
                 StabilityOf(voxel, parameters) >= parameters.stability_threshold) {
        standing_[StandingSlot(at)] = voxel.first_seen;
      }
    });
  }

  // Whether the ground below was known before `time`: whoever met it looked over it.
  bool HasGroundBelow(const VoxelIndex& voxel, uint32_t time) const {
    for (int z = voxel.z - 1; z >= voxel.z - depth_; --z) {
      if (ground_[GroundSlot(voxel.x, voxel.y, z)] < time) return true;
    }
    return false;
  }

  // Whether a neighbour was known before `time`: then the voxel is more of that.
  bool HasNeighbour(const VoxelIndex& voxel, uint32_t time) const {
    for (int z = voxel.z - 1; z <= voxel.z + 1; ++z) {
      for (int y = voxel.y - 1; y <= voxel.y + 1; ++y) {
        for (int x = voxel.x - 1; x <= voxel.x + 1; ++x) {
          if (standing_[StandingSlot({x, y, z})] < time) return true;
        }
      }
    }
    return false;
  }

 private:
  static constexpr int kEdge = kBlockSize + 2;
  static constexpr uint32_t kNever = std::numeric_limits<uint32_t>::max();
  static constexpr uint16_t kFirmHits = 3 * kCountScale;

  static bool IsIn(int32_t c, int margin) { return c >= -margin && c < kBlockSize + margin; }
  size_t GroundSlot(int x, int y, int z) const {
    return (static_cast<size_t>(z + depth_) * kBlockSize + static_cast<size_t>(y)) * kBlockSize +
           static_cast<size_t>(x);
  }
  static size_t StandingSlot(const VoxelIndex& at) {
    return (static_cast<size_t>(at.z + 1) * kEdge + static_cast<size_t>(at.y + 1)) * kEdge +
           static_cast<size_t>(at.x + 1);
  }

  const int depth_;
  std::vector<uint32_t> ground_, standing_;  // when it was first met
};

// Whether a voxel has to wait for a second session. Ground is where it is.
bool MayBeNew(const Voxel& voxel) { return !voxel.ground && voxel.first_seen == voxel.last_seen; }

// What one session alone met in the block and eight voxels around it, and how wide it is as far as it hangs together.
class NewThings {
 public:
  explicit NewThings(const BlockNeighbourhood& blocks) : things_(static_cast<size_t>(kEdge) * kEdge * kEdge, kNone) {
    std::vector<VoxelIndex> open;
    ForEachWithin(blocks, kMargin, [&](const Voxel& voxel, const VoxelIndex& at, bool) {
      if (!MayBeNew(voxel)) return;
      things_[SlotOf(at)] = kUnknown;
      open.push_back(at);
    });
    for (const VoxelIndex& at : open) {
      if (things_[SlotOf(at)] == kUnknown) Follow(at);
    }
  }

  // Voxels from one side to the other, the larger of x and y.
  int WidthAt(const VoxelIndex& voxel) const { return widths_[static_cast<size_t>(things_[SlotOf(voxel)])]; }

 private:
  static constexpr int kEdge = kBlockSize + 2 * kMargin;
  static constexpr int32_t kNone = -1, kUnknown = -2;

  static size_t SlotOf(const VoxelIndex& at) {
    return (static_cast<size_t>(at.z + kMargin) * kEdge + static_cast<size_t>(at.y + kMargin)) * kEdge +
           static_cast<size_t>(at.x + kMargin);
  }
  static bool IsIn(int32_t c) { return c >= -kMargin && c < kBlockSize + kMargin; }

  // Neighbours of neighbours hang together: a car far away is lines with gaps.
  void Follow(const VoxelIndex& start) {
    constexpr int kGap = 2;
    const auto thing = static_cast<int32_t>(widths_.size());
    VoxelIndex low = start, high = start;
    std::vector<VoxelIndex> reached = {start};
    things_[SlotOf(start)] = thing;
    while (!reached.empty()) {
      const VoxelIndex at = reached.back();
      reached.pop_back();
      low = {std::min(low.x, at.x), std::min(low.y, at.y), 0};
      high = {std::max(high.x, at.x), std::max(high.y, at.y), 0};
      for (int z = at.z - kGap; z <= at.z + kGap; ++z) {
        for (int y = at.y - kGap; y <= at.y + kGap; ++y) {
          for (int x = at.x - kGap; x <= at.x + kGap; ++x) {
            if (!IsIn(x) || !IsIn(y) || !IsIn(z) || things_[SlotOf({x, y, z})] != kUnknown) continue;
            things_[SlotOf({x, y, z})] = thing;
            reached.push_back({x, y, z});
          }
        }
      }
    }
    widths_.push_back(std::max(high.x - low.x, high.y - low.y) + 1);
  }

  std::vector<int32_t> things_;  // of each voxel
  std::vector<int> widths_;      // of each thing
};

}  // namespace

std::vector<MapVerdict> FilterBlock(const BlockNeighbourhood& blocks, const MapFilterParameters& parameters) {
  const std::vector<Voxel>& voxels = blocks[kCentre]->voxels;
  // The ground is neither a candidate nor isolated noise, nor new.
  if (std::ranges::all_of(voxels, &Voxel::ground)) return std::vector<MapVerdict>(voxels.size(), MapVerdict::kStatic);
  const std::vector<bool> dynamic = DynamicCandidates(blocks, parameters);
  const Occupancy occupancy(blocks);
  std::optional<Known> known;
  if (parameters.probation_height > 0 && std::ranges::any_of(voxels, MayBeNew)) known.emplace(blocks, parameters);
  std::optional<NewThings> things;
  const auto is_narrow = [&](const VoxelIndex& at) {
    if (parameters.probation_width <= 0) return true;
    if (!things) things.emplace(blocks);
    return things->WidthAt(at) * parameters.voxel_size <= parameters.probation_width + 1e-9;
  };
  std::vector<MapVerdict> verdicts;
  verdicts.reserve(voxels.size());
  size_t next_candidate = 0;
  ForEachWithin(blocks, 0, [&](const Voxel& voxel, const VoxelIndex& at, bool) {
    const bool gone = IsCandidate(voxel, parameters) && dynamic[next_candidate++];
    const bool isolated = !voxel.ground && occupancy.NeighboursOf(at) < parameters.isolated_min_neighbours;
    const bool waits = known.has_value() && MayBeNew(voxel) && known->HasGroundBelow(at, voxel.first_seen) &&
                       !known->HasNeighbour(at, voxel.first_seen) && is_narrow(at);
    verdicts.push_back(gone || isolated ? MapVerdict::kGone : waits ? MapVerdict::kNew : MapVerdict::kStatic);
  });
  return verdicts;
}

}  // namespace mapkeep
