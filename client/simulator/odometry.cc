#include "client/simulator/odometry.h"

#include <array>
#include <cmath>
#include <numbers>

#include "client/simulator/random_stream.h"

namespace mapkeep {
namespace {

constexpr double kSwingPeriod = 37;  // metres
constexpr double kDriftLength = 100;

/// A small motion a metre of travel.
struct Bias {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  // metres
  double yaw = 0, pitch = 0;                              // radians
};

Bias DrawBias(double drift, RandomStream& random) {
  // Shares of the drift at 100 m: along, left, up by translation, then left by yaw and up by pitch.
  Eigen::Matrix<double, 5, 1> shares;
  const Eigen::Matrix<double, 5, 1> weights(0.6, 0.25, 0.2, 0.6, 0.3);
  for (int i = 0; i < 5; ++i) shares[i] = weights[i] * random.Normal();
  // What each axis gets in the end; it is this that must be as long as asked.
  const Eigen::Vector3d sum(shares[0], shares[1] + shares[3], shares[2] + shares[4]);
  shares *= drift / std::max(sum.norm(), 1e-9);
  // A turn of r radians a metre leads r L^2 / 2 aside after L metres.
  constexpr double kAside = kDriftLength * kDriftLength / 2;
  return {shares.head<3>() / kDriftLength, shares[3] / kAside, -shares[4] / kAside};
}

}  // namespace

std::vector<Pose> OdometryOf(std::span<const Pose> truth, const OdometryParameters& parameters, uint64_t seed) {
  RandomStream random(seed);
  Bias bias = DrawBias(parameters.drift, random);
  const double phase = random.Uniform(0, 2 * std::numbers::pi);
  std::vector<Pose> odometry;
  odometry.reserve(truth.size());
  // Heading and place are unknown to odometry, but gravity is not.
  Pose pose = Pose::Identity();
  if (!truth.empty()) {
    const Eigen::Vector3d heading = truth[0].linear().col(0);
    pose.linear() =
        Eigen::AngleAxisd(-std::atan2(heading.y(), heading.x()), Eigen::Vector3d::UnitZ()) * truth[0].linear();
  }
  double travel = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    if (i > 0) {
      const Pose step = truth[i - 1].inverse() * truth[i];
      const double length = step.translation().norm();
      const double swing = 1 + 0.5 * std::sin(2 * std::numbers::pi * travel / kSwingPeriod + phase);
      travel += length;
      Pose error = Pose::Identity();
      error.linear() = (Eigen::AngleAxisd(swing * length * bias.yaw, Eigen::Vector3d::UnitZ()) *
                        Eigen::AngleAxisd(swing * length * bias.pitch, Eigen::Vector3d::UnitY()))
                           .toRotationMatrix();
      error.translation() = swing * length * bias.translation;
      pose = pose * step * error;
      pose.linear() = Eigen::Quaterniond(pose.linear()).normalized().toRotationMatrix();
    }
    Pose noisy = pose;
    const auto draw = [&](double deviation) {
      return Eigen::Vector3d(deviation * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()));
    };
    noisy.translation() += draw(parameters.position_noise);
    const Eigen::Vector3d turn = draw(parameters.rotation_noise);
    if (turn.norm() > 0) noisy.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    odometry.push_back(noisy);
  }
  return odometry;
}

}  // namespace mapkeep
