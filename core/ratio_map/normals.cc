#include "core/ratio_map/normals.h"

#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>

#include "core/voxels/normal.h"

namespace mapkeep {
namespace {

// Below this share of the largest eigenvalue the second one says "a line", and a line has no normal.
constexpr double kLineShare = 0.03;
constexpr int kMinSurfels = 3;
constexpr int kMaxReach = 2;  // voxels to each side

// The lower half of a symmetric matrix, which is all that an eigenvalue solver reads: xx xy yy xz yz zz.
using Symmetric = std::array<double, 6>;

// Calls visit(entry, row, column) for the entries of a lower half.
template <typename Visit>
void ForEachEntry(const Visit& visit) {
  for (int row = 0, entry = 0; row < 3; ++row) {
    for (int column = 0; column <= row; ++column) visit(entry++, row, column);
  }
}

// Scatter of the occupied sub-voxel centres about their mean, in voxel edges squared, and their count.
struct Spread {
  double cells = 0;
  Symmetric scatter{};
};

Spread SpreadOf(uint64_t mask) {
  Spread spread;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Symmetric products{};
  for (uint64_t rest = mask; rest != 0; rest &= rest - 1) {
    const int bit = std::countr_zero(rest);
    const Eigen::Vector3d cell = Eigen::Vector3d(bit % 4, (bit >> 2) % 4, bit >> 4) / 4;
    sum += cell;
    ForEachEntry([&](int entry, int row, int column) { products[entry] += cell[row] * cell[column]; });
  }
  spread.cells = std::popcount(mask);
  if (spread.cells == 0) return spread;
  ForEachEntry([&](int entry, int row, int column) {
    spread.scatter[entry] = products[entry] - sum[row] * sum[column] / spread.cells;
  });
  return spread;
}

// The surfels of one block, a run of the sorted list.
struct BlockRun {
  BlockKey key{};
  size_t begin = 0, end = 0;
};

std::vector<BlockRun> BlockRunsOf(std::span<const Surfel> surfels) {
  std::vector<BlockRun> runs;
  for (size_t i = 0; i < surfels.size(); ++i) {
    const BlockKey key = BlockKeyOf(surfels[i].key);
    if (runs.empty() || runs.back().key != key) runs.push_back({key, i, i});
    runs.back().end = i + 1;
  }
  return runs;
}

// The surfels of a block and of a margin around it, in a dense grid.
class Surroundings {
 public:
  struct Entry {
    Eigen::Vector3d mean;  // voxel edges from the block's corner
    Spread spread;
  };

  Surroundings(std::span<const Surfel> surfels, std::span<const BlockRun> runs, const BlockRun& centre)
      : grid_(kEdge * kEdge * kEdge, kNone) {
    const VoxelIndex block = BlockIndexOf(centre.key);
    for (const VoxelIndex& at : NeighbourhoodOf(block)) {
      if (!InRange({at.x * kBlockSize, at.y * kBlockSize, at.z * kBlockSize})) continue;
      const auto run = std::ranges::lower_bound(runs, BlockKeyOf(at), {}, &BlockRun::key);
      if (run == runs.end() || run->key != BlockKeyOf(at)) continue;
      for (const Surfel& surfel : surfels.subspan(run->begin, run->end - run->begin)) Add(surfel, block);
    }
  }

  // Coordinates from the block's corner, within the margin.
  const Entry* At(const VoxelIndex& at) const {
    const int32_t entry = grid_[CellOf(at)];
    return entry == kNone ? nullptr : &entries_[entry];
  }

 private:
  static constexpr size_t kEdge = kBlockSize + 2 * kMaxReach;
  static constexpr int32_t kNone = -1;

  static size_t CellOf(const VoxelIndex& at) {
    const auto shifted = [](int32_t c) { return static_cast<size_t>(c + kMaxReach); };
    return shifted(at.x) + kEdge * (shifted(at.y) + kEdge * shifted(at.z));
  }

  void Add(const Surfel& surfel, const VoxelIndex& block) {
    const VoxelIndex voxel = VoxelIndexOf(surfel.key);
    const VoxelIndex at{voxel.x - block.x * kBlockSize, voxel.y - block.y * kBlockSize, voxel.z - block.z * kBlockSize};
    const auto inside = [](int32_t c) { return c >= -kMaxReach && c < kBlockSize + kMaxReach; };
    if (!inside(at.x) || !inside(at.y) || !inside(at.z)) return;
    grid_[CellOf(at)] = static_cast<int32_t>(entries_.size());
    entries_.push_back({Eigen::Vector3d(at.x, at.y, at.z) + surfel.mean.cast<double>(), SpreadOf(surfel.mask)});
  }

  std::vector<int32_t> grid_;
  std::vector<Entry> entries_;
};

std::array<uint8_t, 2> NormalAt(const VoxelIndex& at, const Surroundings& surroundings, double radius,
                                const Eigen::Vector3d& towards_sensor) {
  const Surroundings::Entry& centre = *surroundings.At(at);
  const int reach = std::min(static_cast<int>(std::ceil(radius)), kMaxReach);
  int count = 0;
  double weight = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Symmetric products{};
  for (int dz = -reach; dz <= reach; ++dz) {
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) {
        const Surroundings::Entry* other = surroundings.At({at.x + dx, at.y + dy, at.z + dz});
        if (other == nullptr) continue;
        const Eigen::Vector3d offset = other->mean - centre.mean;
        if (offset.squaredNorm() > radius * radius) continue;
        ++count;
        weight += other->spread.cells;
        const Eigen::Vector3d weighted = other->spread.cells * offset;
        sum += weighted;
        ForEachEntry([&](int entry, int row, int column) {
          products[entry] += weighted[row] * offset[column] + other->spread.scatter[entry];
        });
      }
    }
  }
  if (count < kMinSurfels) return {0, 0};
  Eigen::Matrix3d covariance;
  ForEachEntry([&](int entry, int row, int column) {
    covariance(row, column) = products[entry] / weight - sum[row] * sum[column] / (weight * weight);
  });
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  if (!(solver.eigenvalues()[1] > kLineShare * solver.eigenvalues()[2])) return {0, 0};
  const Eigen::Vector3d normal = solver.eigenvectors().col(0);
  return EncodeNormal(normal.dot(towards_sensor) < 0 ? Eigen::Vector3d(-normal) : normal);
}

}  // namespace

std::vector<std::array<uint8_t, 2>> EstimateNormals(std::span<const Surfel> surfels, double radius_voxels) {
  std::vector<std::array<uint8_t, 2>> normals(surfels.size());
  const double radius = std::clamp(radius_voxels, 0.0, static_cast<double>(kMaxReach));
  const std::vector<BlockRun> runs = BlockRunsOf(surfels);
  tbb::parallel_for(size_t{0}, runs.size(), [&](size_t run) {
    const Surroundings surroundings(surfels, runs, runs[run]);
    for (size_t i = runs[run].begin; i < runs[run].end; ++i) {
      constexpr int kMask = kBlockSize - 1;
      const VoxelIndex voxel = VoxelIndexOf(surfels[i].key);
      normals[i] = NormalAt({voxel.x & kMask, voxel.y & kMask, voxel.z & kMask}, surroundings, radius,
                            surfels[i].towards_sensor.cast<double>());
    }
  });
  return normals;
}

}  // namespace mapkeep
