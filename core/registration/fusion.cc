#include "core/registration/fusion.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

namespace mapkeep {
namespace {

// 1 in the middle of the window, falling to a little above 0 at its ends.
double TaperOf(const Window& window, size_t scan) {
  const double middle = (static_cast<double>(window.first) + static_cast<double>(window.last)) / 2;
  const double half = static_cast<double>(window.last - window.first) / 2 + 1;
  return 1 - std::abs(static_cast<double>(scan) - middle) / half;
}

// Eq. 2: the mean of A_i, or nothing if no window covers the scan.
std::optional<Pose> FusedPose(size_t scan, const Pose& pose, std::span<const TrustedWindow> trusted) {
  std::vector<Pose> estimates;
  std::vector<double> weights;
  for (const TrustedWindow& window : trusted) {
    if (scan < window.window.first || scan > window.window.last) continue;
    estimates.push_back(window.correction * pose);
    weights.push_back(window.fitness * TaperOf(window.window, scan));
  }
  if (estimates.empty()) return std::nullopt;
  return BlendPoses(estimates, weights);
}

std::vector<double> TravelOf(std::span<const Pose> poses) {
  std::vector<double> travel(poses.size());
  for (size_t i = 1; i < poses.size(); ++i) {
    travel[i] = travel[i - 1] + (poses[i].translation() - poses[i - 1].translation()).norm();
  }
  return travel;
}

}  // namespace

Pose BlendPoses(std::span<const Pose> poses, std::span<const double> weights) {
  double sum = 0;
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Matrix4d quaternions = Eigen::Matrix4d::Zero();
  for (size_t i = 0; i < poses.size(); ++i) {
    sum += weights[i];
    translation += weights[i] * poses[i].translation();
    const Eigen::Vector4d quaternion = Eigen::Quaterniond(poses[i].linear()).coeffs();
    quaternions += weights[i] * quaternion * quaternion.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(quaternions);
  Pose blended = Pose::Identity();
  const Eigen::Vector4d mean = solver.eigenvectors().col(3);
  blended.linear() = Eigen::Quaterniond(mean).normalized().toRotationMatrix();
  blended.translation() = translation / sum;
  return blended;
}

std::vector<Pose> FusePoses(std::span<const Pose> poses, std::span<const TrustedWindow> trusted) {
  std::vector<std::optional<Pose>> fused(poses.size());
  std::vector<size_t> covered;
  for (size_t i = 0; i < poses.size(); ++i) {
    fused[i] = FusedPose(i, poses[i], trusted);
    if (fused[i]) covered.push_back(i);
  }
  const std::vector<double> travel = TravelOf(poses);
  // What odometry makes of scan i from the fused pose of scan `from`.
  const auto carried = [&](size_t i, size_t from) { return *fused[from] * (poses[from].inverse() * poses[i]); };
  std::vector<Pose> result;
  result.reserve(poses.size());
  for (size_t i = 0; i < poses.size(); ++i) {
    const auto after = std::ranges::lower_bound(covered, i);
    if (after != covered.end() && *after == i) {
      result.push_back(*fused[i]);
    } else if (after == covered.begin()) {
      result.push_back(carried(i, *after));
    } else if (after == covered.end()) {
      result.push_back(carried(i, covered.back()));
    } else {
      const size_t before = *(after - 1);
      const double to_before = travel[i] - travel[before], to_after = travel[*after] - travel[i];
      const double share = to_before + to_after > 0 ? to_after / (to_before + to_after) : 0.5;
      const std::array<Pose, 2> ends{carried(i, before), carried(i, *after)};
      const std::array<double, 2> weights{share, 1 - share};
      result.push_back(BlendPoses(ends, weights));
    }
  }
  return result;
}

}  // namespace mapkeep
