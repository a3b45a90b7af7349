#include "core/registration/fitness.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace mapkeep {
namespace {

constexpr size_t kGrain = 512;

struct Sums {
  size_t inliers = 0;
  size_t with_normal = 0;
  Eigen::Matrix3d normals = Eigen::Matrix3d::Zero();
};

}  // namespace

Fit FitOf(std::span<const Eigen::Vector3d> points, const SurfaceCloud& target, const PointTree& tree, const Pose& pose,
          double inlier_distance) {
  if (points.empty()) return {};
  const auto add_range = [&](const tbb::blocked_range<size_t>& range, Sums sums) {
    for (size_t i = range.begin(); i < range.end(); ++i) {
      const auto match = tree.Nearest(pose * points[i], inlier_distance);
      if (!match) continue;
      ++sums.inliers;
      const Eigen::Vector3d& normal = target.normals[match->index];
      if (normal.isZero()) continue;
      ++sums.with_normal;
      sums.normals += normal * normal.transpose();
    }
    return sums;
  };
  const auto join = [](Sums a, const Sums& b) {
    a.inliers += b.inliers;
    a.with_normal += b.with_normal;
    a.normals += b.normals;
    return a;
  };
  const Sums sums =
      tbb::parallel_deterministic_reduce(tbb::blocked_range<size_t>(0, points.size(), kGrain), Sums(), add_range, join);
  Fit fit{.inliers = sums.inliers, .fitness = static_cast<double>(sums.inliers) / static_cast<double>(points.size())};
  if (sums.with_normal > 0) {
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(sums.normals / static_cast<double>(sums.with_normal),
                                                          Eigen::EigenvaluesOnly);
    fit.observability = std::max(0.0, solver.eigenvalues()[0]);
  }
  return fit;
}

}  // namespace mapkeep
