#include "core/registration/position_prior.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>

namespace mapkeep {

bool IsCovariance(const Eigen::Matrix3d& matrix) {
  if (!matrix.allFinite() || !matrix.isApprox(matrix.transpose(), 1e-9)) return false;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(matrix, Eigen::EigenvaluesOnly);
  // Beside the largest one, 0 may come out as a little more.
  return solver.eigenvalues()[0] > 1e-12 * solver.eigenvalues()[2];
}

double ReachOf(const PositionPrior& prior) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(prior.covariance, Eigen::EigenvaluesOnly);
  return kMostDeviations * std::sqrt(solver.eigenvalues()[2]);
}

double DeviationsFrom(const PositionPrior& prior, const Eigen::Vector3d& place, double metres) {
  const Eigen::Matrix3d covariance = prior.covariance + metres * metres * Eigen::Matrix3d::Identity();
  const Eigen::Vector3d off = place - prior.position;
  return std::sqrt(off.dot(covariance.ldlt().solve(off)));
}

}  // namespace mapkeep
