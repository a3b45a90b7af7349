#include "core/registration/surface_normals.h"

#include <tbb/parallel_for.h>

#include <Eigen/Eigenvalues>

namespace mapkeep {
namespace {

constexpr int kNeighbours = 12;
constexpr size_t kMinNeighbours = 5;
constexpr double kLineShare = 0.01;  // middle over largest eigenvalue below which the neighbours make a line

SurfaceNormal NormalThrough(std::span<const PointTree::Match> neighbours, std::span<const Eigen::Vector3d> points) {
  if (neighbours.size() < kMinNeighbours) return {};
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& match : neighbours) mean += points[match.index];
  mean /= static_cast<double>(neighbours.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto& match : neighbours) {
    const Eigen::Vector3d offset = points[match.index] - mean;
    covariance += offset * offset.transpose();
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  const Eigen::Vector3d values = solver.eigenvalues();
  if (!(values[1] > kLineShare * values[2])) return {};
  const Eigen::Vector3d normal = solver.eigenvectors().col(0);
  if (!normal.allFinite()) return {};
  return {normal.normalized(), std::max(values[0], 0.0) / values[1]};
}

}  // namespace

std::vector<SurfaceNormal> SurfaceNormalsAt(std::span<const Eigen::Vector3d> at,
                                            std::span<const Eigen::Vector3d> points, const PointTree& tree) {
  std::vector<SurfaceNormal> normals(at.size());
  tbb::parallel_for(size_t{0}, at.size(),
                    [&](size_t i) { normals[i] = NormalThrough(tree.Nearest(at[i], kNeighbours), points); });
  return normals;
}

}  // namespace mapkeep
