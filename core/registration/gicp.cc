#include "core/registration/gicp.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "core/registration/correspondences.h"

namespace mapkeep {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double kFlatness = 1e-3;  // variance of a disc along its normal, over that in its plane
constexpr size_t kGrain = 256;
// Keeps the normal equations regular where the geometry leaves a motion free; per pair, against 1 / (2 kFlatness) for
// what a plane fixes.
constexpr double kDamping = 1e-4;

// The normal equations of one Gauss-Newton step in the motion (translation, rotation about a centre).
struct NormalEquations {
  Matrix6 hessian = Matrix6::Zero();
  Vector6 gradient = Vector6::Zero();
  size_t pairs = 0;

  void Add(const NormalEquations& other) {
    hessian += other.hessian;
    gradient += other.gradient;
    pairs += other.pairs;
  }
};

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

// One pair: difference `error` = target - source, `arm` from the centre of rotation to the source point.
void AddPair(const Eigen::Vector3d& error, const Eigen::Vector3d& arm, const Eigen::Vector3d& target_normal,
             const Eigen::Vector3d& source_normal, double robust_width, NormalEquations& sum) {
  const Eigen::Matrix3d covariance =
      2 * Eigen::Matrix3d::Identity() -
      (1 - kFlatness) * (target_normal * target_normal.transpose() + source_normal * source_normal.transpose());
  const Eigen::Matrix3d information = covariance.inverse();
  const Eigen::Vector3d weighted = information * error;
  // 2 kFlatness e^T M e is about the squared distance along the normal of two parallel discs.
  const double squared = 2 * kFlatness * error.dot(weighted);
  const double weight = 1 / (1 + squared / (robust_width * robust_width));
  const Eigen::Matrix3d cross = CrossMatrix(arm);
  // The source point moves by t + r x arm = t - [arm]x r.
  const Eigen::Matrix3d cross_information = cross * information;  // = ([arm]x^T M)^T up to sign
  sum.hessian.topLeftCorner<3, 3>() += weight * information;
  sum.hessian.bottomLeftCorner<3, 3>() += weight * cross_information;
  sum.hessian.bottomRightCorner<3, 3>() -= weight * cross_information * cross;
  sum.gradient.head<3>() += weight * weighted;
  sum.gradient.tail<3>() += weight * (cross * weighted);
  ++sum.pairs;
}

NormalEquations Linearise(const SurfaceCloud& source, const SurfaceCloud& target, Correspondences& pairs,
                          const Pose& pose, const Eigen::Vector3d& centre, const GicpParameters& parameters) {
  const auto add_range = [&](const tbb::blocked_range<size_t>& range, NormalEquations sum) {
    for (size_t i = range.begin(); i < range.end(); ++i) {
      const Eigen::Vector3d point = pose * source.points[i];
      const auto match = pairs.Match(i, point);
      if (!match) continue;
      AddPair(target.points[*match] - point, point - centre, target.normals[*match], pose.linear() * source.normals[i],
              parameters.robust_width, sum);
    }
    return sum;
  };
  const auto join = [](NormalEquations a, const NormalEquations& b) {
    a.Add(b);
    return a;
  };
  auto sum = tbb::parallel_deterministic_reduce(tbb::blocked_range<size_t>(0, source.points.size(), kGrain),
                                                NormalEquations(), add_range, join);
  sum.hessian.topRightCorner<3, 3>() = sum.hessian.bottomLeftCorner<3, 3>().transpose();
  return sum;
}

Pose Moved(const Pose& pose, const Vector6& step, const Eigen::Vector3d& centre) {
  const Eigen::Vector3d rotation = step.tail<3>();
  const double angle = rotation.norm();
  Pose moved = pose;
  if (angle > 0) {
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, rotation / angle).toRotationMatrix();
    moved.linear() = Eigen::Quaterniond(turn * pose.linear()).normalized().toRotationMatrix();
    moved.translation() = turn * (pose.translation() - centre) + centre;
  }
  moved.translation() += step.head<3>();
  return moved;
}

Eigen::Vector3d MeanOf(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

}  // namespace

GicpResult RefineByGicp(const SurfaceCloud& source, const SurfaceCloud& target, const PointTree& tree,
                        const Pose& guess, const GicpParameters& parameters) {
  GicpResult result{.pose = guess};
  if (source.points.empty()) return result;
  const Eigen::Vector3d middle = MeanOf(source.points);
  Correspondences pairs(source.points.size(), target.points, tree, parameters.max_correspondence);
  for (int i = 0; i < parameters.max_iterations && !result.converged; ++i) {
    const Eigen::Vector3d centre = result.pose * middle;
    NormalEquations sum = Linearise(source, target, pairs, result.pose, centre, parameters);
    result.pairs = sum.pairs;
    if (sum.pairs == 0) return result;
    result.centre = centre;
    result.information = 2 * kFlatness * sum.hessian;
    sum.hessian.diagonal().array() += kDamping * static_cast<double>(sum.pairs);
    const Vector6 step = sum.hessian.ldlt().solve(sum.gradient);
    if (!step.allFinite()) return result;
    result.pose = Moved(result.pose, step, centre);
    result.converged = step.head<3>().norm() < parameters.translation_tolerance &&
                       step.tail<3>().norm() < parameters.rotation_tolerance;
  }
  return result;
}

}  // namespace mapkeep
