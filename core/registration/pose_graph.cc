#include "core/registration/pose_graph.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

namespace mapkeep {
namespace {

// Deviations of odometry over one step: a floor, and a share of the metres travelled. Only their ratio to those of the
// windows matters.
constexpr double kStepMetres = 0.002;
constexpr double kStepMetresPerMetre = 0.01;
constexpr double kStepRadians = 0.0002;
constexpr double kStepRadiansPerMetre = 0.0005;
// Deviations of a window in its best fixed directions; in others they grow up to kMaxLooseness times.
constexpr double kWindowMetres = 0.01;
constexpr double kWindowRadians = 0.0006;
constexpr double kMaxLooseness = 10;
// Of a scan on its own: how far a point is off its surface, and how many err together.
constexpr double kPairMetres = 0.05;
constexpr double kPairsTogether = 20;
constexpr size_t kMinScanPairs = 100;
constexpr double kHuberWidth = 3;  // deviations at which a window begins to pull less

// A pose as Ceres moves it: a rotation vector and a translation, relative to a start. Small corrections only.
using Block = std::array<double, 6>;

template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;
template <typename T>
using Quaternion = Eigen::Quaternion<T>;

template <typename T>
Quaternion<T> TurnOf(const T* vector) {
  T q[4];
  ceres::AngleAxisToQuaternion(vector, q);
  return Quaternion<T>(q[0], q[1], q[2], q[3]);
}

template <typename T>
Vector3<T> VectorOf(const Quaternion<T>& turn) {
  const T q[4] = {turn.w(), turn.x(), turn.y(), turn.z()};
  Vector3<T> vector;
  ceres::QuaternionToAngleAxis(q, vector.data());
  return vector;
}

// A scan's pose: the start turned about its own sensor, and shifted.
template <typename T>
void PoseOf(const T* block, const Pose& start, Quaternion<T>& turn, Vector3<T>& place) {
  turn = TurnOf(block) * Quaternion<T>(Eigen::Quaterniond(start.linear()).cast<T>());
  place = start.translation().cast<T>() + Vector3<T>(block[3], block[4], block[5]);
}

// Odometry between two scans.
struct StepCost {
  Pose start_a, start_b;
  Pose step;  // T_a_b by odometry
  double metres, radians;

  template <typename T>
  bool operator()(const T* a, const T* b, T* residuals) const {
    Quaternion<T> turn_a, turn_b;
    Vector3<T> place_a, place_b;
    PoseOf(a, start_a, turn_a, place_a);
    PoseOf(b, start_b, turn_b, place_b);
    const Vector3<T> between = turn_a.conjugate() * (place_b - place_a);
    const Quaternion<T> turn =
        turn_a.conjugate() * turn_b * Quaternion<T>(Eigen::Quaterniond(step.linear()).conjugate().cast<T>());
    Eigen::Map<Eigen::Matrix<T, 6, 1>> r(residuals);
    r.template head<3>() = (between - step.translation().cast<T>()) / T(metres);
    r.template tail<3>() = VectorOf(turn) / T(radians);
    return true;
  }
};

// Where a window says that one of its scans lies, weighted by the root of its information about that scan's sensor.
struct WindowCost {
  Pose start;
  Pose said;
  Eigen::Matrix<double, 6, 6> root;

  template <typename T>
  bool operator()(const T* block, T* residuals) const {
    Quaternion<T> turn;
    Vector3<T> place;
    PoseOf(block, start, turn, place);
    Eigen::Matrix<T, 6, 1> off;
    off.template head<3>() = place - said.translation().cast<T>();
    off.template tail<3>() = VectorOf(Quaternion<T>(turn * Eigen::Quaterniond(said.linear()).conjugate().cast<T>()));
    Eigen::Map<Eigen::Matrix<T, 6, 1>>(residuals, 6, 1) = root.cast<T>() * off;
    return true;
  }
};

// Roots of the eigenvalues relative to the largest, no smaller than 1 / kMaxLooseness: how firmly each direction of a
// 3x3 information is fixed.
Eigen::Matrix3d Firmness(const Eigen::Matrix3d& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(information);
  const double largest = solver.eigenvalues()[2];
  if (!(largest > 0)) return Eigen::Matrix3d::Identity();
  const Eigen::Vector3d share = (solver.eigenvalues() / largest).cwiseMax(0).cwiseSqrt().cwiseMax(1 / kMaxLooseness);
  return solver.eigenvectors() * share.asDiagonal() * solver.eigenvectors().transpose();
}

Eigen::Matrix<double, 6, 6> RootOf(const TrustedWindow& window) {
  Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::Zero();
  root.topLeftCorner<3, 3>() = Firmness(window.information.topLeftCorner<3, 3>()) / kWindowMetres;
  root.bottomRightCorner<3, 3>() = Firmness(window.information.bottomRightCorner<3, 3>()) / kWindowRadians;
  return root;
}

Eigen::Matrix<double, 6, 6> RootOf(const ScanPlacement& scan) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> solver(scan.information);
  const Eigen::Matrix<double, 6, 1> roots =
      (solver.eigenvalues().cwiseMax(0) / (kPairMetres * kPairMetres * kPairsTogether)).cwiseSqrt();
  return solver.eigenvectors() * roots.asDiagonal() * solver.eigenvectors().transpose();
}

}  // namespace

std::vector<Pose> OptimisePoses(std::span<const Pose> poses, std::span<const TrustedWindow> trusted,
                                std::span<const ScanPlacement> scans) {
  const std::vector<Pose> start = FusePoses(poses, trusted);
  std::vector<Block> blocks(poses.size(), Block{});
  ceres::Problem problem;
  for (Block& block : blocks) problem.AddParameterBlock(block.data(), 6);
  for (size_t i = 1; i < poses.size(); ++i) {
    const Pose step = poses[i - 1].inverse() * poses[i];
    const double travel = step.translation().norm();
    auto* cost = new StepCost{start[i - 1], start[i], step, kStepMetres + kStepMetresPerMetre * travel,
                              kStepRadians + kStepRadiansPerMetre * travel};
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<StepCost, 6, 6, 6>(cost), nullptr, blocks[i - 1].data(),
                             blocks[i].data());
  }
  for (const TrustedWindow& window : trusted) {
    const size_t middle = (window.window.first + window.window.last) / 2;
    auto* cost = new WindowCost{start[middle], window.correction * poses[middle], RootOf(window)};
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<WindowCost, 6, 6>(cost), new ceres::HuberLoss(kHuberWidth),
                             blocks[middle].data());
  }
  for (size_t i = 0; i < scans.size(); ++i) {
    if (scans[i].pairs < kMinScanPairs) continue;
    auto* cost = new WindowCost{start[i], scans[i].pose, RootOf(scans[i])};
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<WindowCost, 6, 6>(cost), new ceres::HuberLoss(kHuberWidth),
                             blocks[i].data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.num_threads = 1;  // the same bits on any machine's number of cores
  options.max_num_iterations = 30;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) return start;
  std::vector<Pose> result(poses.size());
  for (size_t i = 0; i < poses.size(); ++i) {
    Quaternion<double> turn;
    Eigen::Vector3d place;
    PoseOf(blocks[i].data(), start[i], turn, place);
    result[i] = Eigen::Translation3d(place) * turn.normalized();
  }
  return result;
}

}  // namespace mapkeep
