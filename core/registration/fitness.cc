#include "core/registration/fitness.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <optional>

namespace mapkeep {
namespace {

constexpr size_t kGrain = 512;

constexpr double kCoverageCell = 2;  // metres

// Of a cell of the coverage grid; nothing for points out of its range.
std::optional<uint64_t> CellOf(const Eigen::Vector3d& point) {
  constexpr double kLimit = 1 << 20;
  const Eigen::Vector3d cell = (point / kCoverageCell).array().floor();
  if (!cell.allFinite() || !(cell.cwiseAbs().maxCoeff() < kLimit)) return {};
  const auto bits = [](double c) { return static_cast<uint64_t>(static_cast<int64_t>(c + kLimit)); };
  return bits(cell.x()) | bits(cell.y()) << 21 | bits(cell.z()) << 42;
}

struct Sums {
  size_t inliers = 0;
  size_t on_surface = 0;
  size_t covered = 0;
  size_t with_normal = 0;
  Eigen::Matrix3d normals = Eigen::Matrix3d::Zero();
};

}  // namespace

Coverage::Coverage(std::span<const Eigen::Vector3d> target) {
  uint64_t last = ~uint64_t{0};
  for (const Eigen::Vector3d& point : target) {
    const auto cell = CellOf(point);
    if (!cell || *cell == last) continue;
    cells_.push_back(*cell);
    last = *cell;
  }
  std::ranges::sort(cells_);
  cells_.erase(std::unique(cells_.begin(), cells_.end()), cells_.end());
}

bool Coverage::Holds(const Eigen::Vector3d& point) const {
  const auto cell = CellOf(point);
  return cell && std::ranges::binary_search(cells_, *cell);
}

Fit FitOf(std::span<const Eigen::Vector3d> points, const SurfaceCloud& target, const PointTree& tree,
          const Coverage& coverage, const Pose& pose, double inlier_distance) {
  if (points.empty()) return {};
  const auto add_range = [&](const tbb::blocked_range<size_t>& range, Sums sums) {
    for (size_t i = range.begin(); i < range.end(); ++i) {
      const Eigen::Vector3d point = pose * points[i];
      const auto match = tree.Nearest(point, inlier_distance);
      if (match || coverage.Holds(point)) ++sums.covered;
      if (!match) continue;
      ++sums.inliers;
      const Eigen::Vector3d& normal = target.normals[match->index];
      if (normal.isZero()) continue;
      ++sums.with_normal;
      if (std::abs(normal.dot(point - target.points[match->index])) <= kSurfaceDistance) ++sums.on_surface;
      sums.normals += normal * normal.transpose();
    }
    return sums;
  };
  const auto join = [](Sums a, const Sums& b) {
    a.inliers += b.inliers;
    a.on_surface += b.on_surface;
    a.covered += b.covered;
    a.with_normal += b.with_normal;
    a.normals += b.normals;
    return a;
  };
  const Sums sums =
      tbb::parallel_deterministic_reduce(tbb::blocked_range<size_t>(0, points.size(), kGrain), Sums(), add_range, join);
  const auto all = static_cast<double>(points.size());
  Fit fit{.inliers = sums.inliers,
          .fitness = static_cast<double>(sums.inliers) / static_cast<double>(std::max<size_t>(sums.covered, 1)),
          .precision = static_cast<double>(sums.on_surface) / static_cast<double>(std::max<size_t>(sums.inliers, 1)),
          .surface_share = static_cast<double>(sums.on_surface) / all,
          .coverage = static_cast<double>(sums.covered) / all};
  if (sums.with_normal > 0) {
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(sums.normals / static_cast<double>(sums.with_normal),
                                                          Eigen::EigenvaluesOnly);
    fit.observability = std::max(0.0, solver.eigenvalues()[0]);
  }
  return fit;
}

}  // namespace mapkeep
