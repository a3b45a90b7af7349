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

// Scatter of the occupied sub-voxel centres about their mean, in voxel edges squared, and their count.
struct Spread {
  double cells = 0;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
};

Spread SpreadOf(uint64_t mask) {
  Spread spread;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  for (uint64_t rest = mask; rest != 0; rest &= rest - 1) {
    const int bit = std::countr_zero(rest);
    const Eigen::Vector3d cell(bit % 4 / 4.0, bit / 4 % 4 / 4.0, bit / 16 / 4.0);
    sum += cell;
    products += cell * cell.transpose();
  }
  spread.cells = std::popcount(mask);
  if (spread.cells > 0) spread.scatter = products - sum * sum.transpose() / spread.cells;
  return spread;
}

// The surfels near a voxel: the neighbours in a row along x are neighbours in the list too unless a block ends.
class Neighbours {
 public:
  Neighbours(std::span<const Surfel> surfels, double radius)
      : surfels_(surfels), radius_(radius), reach_(static_cast<int>(std::ceil(radius))) {}

  // visit(surfel, offset of its mean from that of surfel `of`, in voxel edges), in a fixed order.
  template <typename Visit>
  void ForEach(size_t of, const Visit& visit) const {
    const VoxelIndex centre = VoxelIndexOf(surfels_[of].key);
    for (int dz = -reach_; dz <= reach_; ++dz) {
      for (int dy = -reach_; dy <= reach_; ++dy) {
        for (int dx = -reach_; dx <= reach_; ++dx) {
          const VoxelIndex at{centre.x + dx, centre.y + dy, centre.z + dz};
          if (!InRange(at)) continue;
          const auto found = Find(VoxelKeyOf(at), of);
          if (found == surfels_.size()) continue;
          const Eigen::Vector3d offset =
              (surfels_[found].mean - surfels_[of].mean).cast<double>() + Eigen::Vector3d(dx, dy, dz);
          if (offset.squaredNorm() <= radius_ * radius_) visit(surfels_[found], offset);
        }
      }
    }
  }

 private:
  // Keys of neighbours are mostly close in the list: gallop from `near`.
  size_t Find(VoxelKey key, size_t near) const {
    size_t low = near, high = near, step = 1;
    if (surfels_[near].key < key) {
      while (high < surfels_.size() && surfels_[high].key < key) {
        low = high;
        high += step;
        step *= 2;
      }
      high = std::min(high + 1, surfels_.size());
    } else {
      while (low > 0 && surfels_[low].key > key) {
        high = low;
        low = low > step ? low - step : 0;
        step *= 2;
      }
      high = std::min(high + 1, surfels_.size());
    }
    const auto range = surfels_.subspan(low, high - low);
    const auto found = std::ranges::lower_bound(range, key, {}, &Surfel::key);
    return found != range.end() && found->key == key ? low + (found - range.begin()) : surfels_.size();
  }

  std::span<const Surfel> surfels_;
  double radius_;
  int reach_;
};

std::array<uint8_t, 2> NormalOf(const Neighbours& neighbours, const Surfel& surfel, size_t index) {
  int count = 0;
  double weight = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  neighbours.ForEach(index, [&](const Surfel& other, const Eigen::Vector3d& offset) {
    const Spread spread = SpreadOf(other.mask);
    ++count;
    weight += spread.cells;
    sum += spread.cells * offset;
    products += spread.cells * offset * offset.transpose() + spread.scatter;
  });
  if (count < kMinSurfels) return {0, 0};
  const Eigen::Matrix3d covariance = products / weight - sum * sum.transpose() / (weight * weight);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  if (!(solver.eigenvalues()[1] > kLineShare * solver.eigenvalues()[2])) return {0, 0};
  const Eigen::Vector3d normal = solver.eigenvectors().col(0);
  return EncodeNormal(normal.dot(surfel.towards_sensor.cast<double>()) < 0 ? Eigen::Vector3d(-normal) : normal);
}

}  // namespace

std::vector<std::array<uint8_t, 2>> EstimateNormals(std::span<const Surfel> surfels, double radius_voxels) {
  std::vector<std::array<uint8_t, 2>> normals(surfels.size());
  const Neighbours neighbours(surfels, std::clamp(radius_voxels, 0.0, 2.0));
  tbb::parallel_for(size_t{0}, surfels.size(), [&](size_t i) { normals[i] = NormalOf(neighbours, surfels[i], i); });
  return normals;
}

}  // namespace mapkeep
