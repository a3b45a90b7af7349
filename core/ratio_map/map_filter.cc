#include "core/ratio_map/map_filter.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/dor/clusters.h"
#include "core/ratio_map/enclosure.h"
#include "core/ratio_map/neighbourhood.h"
#include "core/ratio_map/probation.h"

namespace mapkeep {
namespace {

// Neighbouring voxels this far from the block's faces take part in its clusters: 1.6 m at 0.2 m, enough to tell an
// object from a stray voxel, and far less work than the whole 26 blocks.
constexpr int kMargin = 8;

double StabilityOf(const Voxel& voxel, const MapFilterParameters& parameters) {
  return Stability(voxel.hits, voxel.exposures, kCountScale * parameters.eta);
}

bool IsCandidate(const Voxel& voxel, const MapFilterParameters& parameters) {
  return !voxel.ground && StabilityOf(voxel, parameters) < parameters.candidate_threshold;
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

}  // namespace

std::vector<MapVerdict> FilterBlock(const BlockNeighbourhood& blocks, const MapFilterParameters& parameters) {
  const std::vector<Voxel>& voxels = blocks[kCentre]->voxels;
  std::vector<MapVerdict> verdicts(voxels.size(), MapVerdict::kStatic);
  const std::vector<bool> waiting = Waiting(blocks, parameters);
  for (size_t i = 0; i < waiting.size(); ++i) {
    if (waiting[i]) verdicts[i] = MapVerdict::kNew;
  }
  const std::vector<bool> enclosed = Enclosed(blocks, parameters);
  for (size_t i = 0; i < enclosed.size(); ++i) {
    if (enclosed[i]) verdicts[i] = MapVerdict::kGone;
  }
  // The ground is neither a candidate nor isolated noise.
  if (std::ranges::all_of(voxels, &Voxel::ground)) return verdicts;
  const std::vector<bool> dynamic = DynamicCandidates(blocks, parameters);
  const Occupancy occupancy(blocks);
  size_t next_candidate = 0;
  for (size_t i = 0; i < voxels.size(); ++i) {
    const bool gone = IsCandidate(voxels[i], parameters) && dynamic[next_candidate++];
    const bool isolated =
        !voxels[i].ground && occupancy.NeighboursOf(IndexIn(voxels[i].position)) < parameters.isolated_min_neighbours;
    if (gone || isolated) verdicts[i] = MapVerdict::kGone;
  }
  return verdicts;
}

}  // namespace mapkeep
