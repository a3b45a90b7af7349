#include "core/registration/solver.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace mapkeep {
namespace {

constexpr int kMaxSteps = 100;  // of graduated non-convexity
constexpr int kMaxRefits = 10;
constexpr double kSettled = 1e-6;  // relative change of the cost at which it ends

// The proper rotation closest to making R * source = target, given sum of weight * source * target^T; nothing if the
// vectors leave a turn open.
std::optional<Eigen::Matrix3d> RotationFrom(const Eigen::Matrix3d& correlation) {
  if (!correlation.allFinite()) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(correlation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (!(svd.singularValues()[1] > 1e-9 * svd.singularValues()[0])) return std::nullopt;
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  signs[2] = (svd.matrixV() * svd.matrixU().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixV() * signs.asDiagonal() * svd.matrixU().transpose();
}

// Weight of a squared residual while the cost is still `mu` away from truncated least squares.
double WeightOf(double squared, double bound_squared, double mu) {
  if (squared >= (mu + 1) / mu * bound_squared) return 0;
  if (squared <= mu / (mu + 1) * bound_squared) return 1;
  return std::clamp(std::sqrt(bound_squared * mu * (mu + 1) / squared) - mu, 0.0, 1.0);
}

// Differences between pairs far apart in the list, which is ordered by nothing that matters: long ones fix a rotation
// best.
std::vector<PointPair> DifferencesOf(std::span<const PointPair> pairs) {
  const size_t count = pairs.size();
  std::vector<PointPair> differences;
  for (const size_t step : {count / 2, count / 3, size_t{1}}) {
    if (step == 0) continue;
    for (size_t i = 0; i < count; ++i) {
      const PointPair& other = pairs[(i + step) % count];
      differences.push_back({other.source - pairs[i].source, other.target - pairs[i].target});
    }
  }
  return differences;
}

std::vector<uint32_t> InliersOf(std::span<const PointPair> pairs, const Pose& pose, double bound) {
  std::vector<uint32_t> inliers;
  for (uint32_t i = 0; i < pairs.size(); ++i) {
    if ((pose * pairs[i].source - pairs[i].target).squaredNorm() <= bound * bound) inliers.push_back(i);
  }
  return inliers;
}

// Least squares (Arun et al., 1987) over some of the pairs; nothing if they lie within `bound` of a line.
std::optional<Pose> FitPose(std::span<const PointPair> pairs, std::span<const uint32_t> chosen, double bound) {
  if (chosen.size() < 3) return std::nullopt;
  const auto count = static_cast<double>(chosen.size());
  Eigen::Vector3d source_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d target_mean = Eigen::Vector3d::Zero();
  for (const uint32_t i : chosen) {
    source_mean += pairs[i].source / count;
    target_mean += pairs[i].target / count;
  }
  Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const uint32_t i : chosen) {
    const Eigen::Vector3d source = pairs[i].source - source_mean;
    correlation += source * (pairs[i].target - target_mean).transpose() / count;
    spread += source * source.transpose() / count;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread, Eigen::EigenvaluesOnly);
  if (!(axes.eigenvalues()[1] > bound * bound)) return std::nullopt;
  const auto rotation = RotationFrom(correlation);
  if (!rotation) return std::nullopt;
  Pose pose = Pose::Identity();
  pose.linear() = *rotation;
  pose.translation() = target_mean - *rotation * source_mean;
  return pose;
}

}  // namespace

std::optional<Eigen::Matrix3d> SolveRotation(std::span<const PointPair> differences, double bound, double factor) {
  const double bound_squared = bound * bound;
  std::vector<double> weights(differences.size(), 1.0);
  std::vector<double> squared(differences.size());
  double mu = 0;  // set from the first residuals
  double previous = std::numeric_limits<double>::infinity();
  std::optional<Eigen::Matrix3d> rotation;
  for (int step = 0; step < kMaxSteps; ++step) {
    Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
    for (size_t i = 0; i < differences.size(); ++i) {
      if (weights[i] > 0) correlation += weights[i] * differences[i].source * differences[i].target.transpose();
    }
    rotation = RotationFrom(correlation);
    if (!rotation) return std::nullopt;
    double cost = 0;
    double largest = 0;
    for (size_t i = 0; i < differences.size(); ++i) {
      squared[i] = (differences[i].target - *rotation * differences[i].source).squaredNorm();
      cost += weights[i] * squared[i];
      largest = std::max(largest, squared[i]);
    }
    if (step == 0) {
      if (largest <= bound_squared) return rotation;
      mu = bound_squared / (2 * largest - bound_squared);
    }
    if (step > 0 && std::abs(cost - previous) <= kSettled * std::max(cost, kSettled)) break;
    previous = cost;
    for (size_t i = 0; i < differences.size(); ++i) weights[i] = WeightOf(squared[i], bound_squared, mu);
    mu *= factor;
  }
  return rotation;
}

double TruncatedMean(std::span<const double> values, double bound) {
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  // Sums run over offsets from the median, which keeps their squares small.
  const double middle = sorted[sorted.size() / 2];
  double best_cost = std::numeric_limits<double>::infinity();
  double best = middle;
  double sum = 0;
  double squares = 0;
  size_t begin = 0;
  size_t end = 0;
  // Each step takes the next end of an interval: the values in [begin, end) are those whose intervals hold the point.
  while (begin < sorted.size()) {
    if (end < sorted.size() && sorted[end] - bound <= sorted[begin] + bound) {
      const double offset = sorted[end++] - middle;
      sum += offset;
      squares += offset * offset;
    } else {
      const double offset = sorted[begin++] - middle;
      sum -= offset;
      squares -= offset * offset;
    }
    const auto inside = static_cast<double>(end - begin);
    if (inside == 0) continue;
    const double cost =
        squares - sum * sum / inside + static_cast<double>(sorted.size() - (end - begin)) * bound * bound;
    if (cost < best_cost) {
      best_cost = cost;
      best = middle + sum / inside;
    }
  }
  return best;
}

std::optional<PoseEstimate> RefitPose(std::span<const PointPair> pairs, const Pose& guess, double bound) {
  PoseEstimate estimate{.pose = guess, .inliers = InliersOf(pairs, guess, bound)};
  for (int i = 0; i < kMaxRefits; ++i) {
    const auto pose = FitPose(pairs, estimate.inliers, bound);
    if (!pose) return std::nullopt;
    auto inliers = InliersOf(pairs, *pose, bound);
    if (inliers.size() < estimate.inliers.size()) break;
    const bool same = inliers == estimate.inliers;
    estimate = {*pose, std::move(inliers)};
    if (same) break;
  }
  return estimate;
}

std::optional<PoseEstimate> SolvePose(std::span<const PointPair> pairs, double bound, double factor) {
  if (pairs.size() < 3) return std::nullopt;
  const auto rotation = SolveRotation(DifferencesOf(pairs), 2 * bound, factor);
  if (!rotation) return std::nullopt;
  Pose pose = Pose::Identity();
  pose.linear() = *rotation;
  std::vector<double> values(pairs.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < pairs.size(); ++i) {
      values[i] = pairs[i].target[axis] - rotation->row(axis).dot(pairs[i].source);
    }
    pose.translation()[axis] = TruncatedMean(values, bound);
  }
  return RefitPose(pairs, pose, bound);
}

}  // namespace mapkeep
