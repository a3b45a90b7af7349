#include "core/dor/surface.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>

namespace mapkeep {
namespace {

// Sub-voxels whose coordinate has bit 0 or bit 1 set, an axis: coordinate = low + 2 high.
constexpr std::array<uint64_t, 3> kLow = {0xaaaaaaaaaaaaaaaaU, 0xf0f0f0f0f0f0f0f0U, 0xffff0000ffff0000U};
constexpr std::array<uint64_t, 3> kHigh = {0xccccccccccccccccU, 0xff00ff00ff00ff00U, 0xffffffff00000000U};

}  // namespace

Moments MomentsOf(uint64_t mask) {
  Moments moments{.count = std::popcount(mask)};
  int at = 0;
  for (int a = 0; a < 3; ++a) {
    const uint64_t low = mask & kLow[a], high = mask & kHigh[a];
    moments.sum[a] = std::popcount(low) + 2 * std::popcount(high);
    for (int b = a; b < 3; ++b) {
      moments.products[at++] = std::popcount(low & kLow[b]) + 4 * std::popcount(high & kHigh[b]) +
                               2 * (std::popcount(low & kHigh[b]) + std::popcount(high & kLow[b]));
    }
  }
  return moments;
}

Moments Moments::Shifted(const std::array<int64_t, 3>& by) const {
  Moments moved{.count = count};
  int at = 0;
  for (int a = 0; a < 3; ++a) {
    moved.sum[a] = sum[a] + count * by[a];
    for (int b = a; b < 3; ++b, ++at) {
      moved.products[at] = products[at] + by[a] * sum[b] + by[b] * sum[a] + count * by[a] * by[b];
    }
  }
  return moved;
}

Moments& Moments::operator+=(const Moments& other) {
  count += other.count;
  for (size_t i = 0; i < sum.size(); ++i) sum[i] += other.sum[i];
  for (size_t i = 0; i < products.size(); ++i) products[i] += other.products[i];
  return *this;
}

Surface SurfaceOf(const Moments& moments) {
  Surface surface;
  if (moments.count < 2) return surface;
  const auto n = static_cast<double>(moments.count);
  Eigen::Matrix3d covariance;
  int at = 0;
  for (int a = 0; a < 3; ++a) {
    for (int b = a; b < 3; ++b, ++at) {
      // Exact in integers up to the last division.
      covariance(a, b) = covariance(b, a) =
          static_cast<double>(moments.products[at] * moments.count - moments.sum[a] * moments.sum[b]) / (n * n);
    }
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  surface.normal = solver.eigenvectors().col(0);
  surface.variances = solver.eigenvalues().reverse().cwiseMax(0);
  return surface;
}

Eigen::Vector3d MeanInVoxel(uint64_t mask) {
  if (mask == 0) return Eigen::Vector3d::Constant(0.5);
  const Moments moments = MomentsOf(mask);
  const Eigen::Vector3d sum(static_cast<double>(moments.sum[0]), static_cast<double>(moments.sum[1]),
                            static_cast<double>(moments.sum[2]));
  return (sum / static_cast<double>(moments.count)).array() / 4 + 0.125;
}

}  // namespace mapkeep
