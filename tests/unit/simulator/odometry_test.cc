#include "client/simulator/odometry.h"

#include <gtest/gtest.h>

#include <cmath>

namespace mapkeep {
namespace {

/// 0.5 m a step along x, from a place that is not the origin.
std::vector<Pose> StraightRide(size_t poses) {
  std::vector<Pose> ride;
  for (size_t i = 0; i < poses; ++i) ride.emplace_back(Eigen::Translation3d(7 + 0.5 * static_cast<double>(i), -3, 1));
  return ride;
}

TEST(Odometry, WithoutDriftItIsTheTruthFromItsFirstPose) {
  const std::vector<Pose> truth = StraightRide(50);
  const std::vector<Pose> odometry = OdometryOf(truth, {}, 3);
  ASSERT_EQ(odometry.size(), truth.size());
  EXPECT_TRUE(odometry[0].isApprox(Pose::Identity(), 1e-12));
  for (size_t i = 0; i < truth.size(); ++i) {
    EXPECT_TRUE((truth[0] * odometry[i]).isApprox(truth[i], 1e-9));
  }
}

TEST(Odometry, DriftsByTheMetresAskedForIn100Metres) {
  const std::vector<Pose> truth = StraightRide(201);
  for (const double drift : {0.3, 1.0}) {
    double squares = 0;
    constexpr uint64_t kSeeds = 40;
    for (uint64_t seed = 0; seed < kSeeds; ++seed) {
      const std::vector<Pose> odometry = OdometryOf(truth, {.drift = drift}, seed);
      const double error = (truth[0] * odometry.back()).translation().x() - truth.back().translation().x();
      const double off = ((truth[0] * odometry.back()).translation() - truth.back().translation()).norm();
      EXPECT_LE(std::abs(error), off);
      EXPECT_NEAR(off, drift, 0.25 * drift) << "seed " << seed;  // its swing is part of it
      squares += off * off / kSeeds;
      const double halfway = ((truth[0] * odometry[100]).translation() - truth[100].translation()).norm();
      EXPECT_LT(halfway, off);
    }
    EXPECT_NEAR(std::sqrt(squares), drift, 0.1 * drift);
  }
}

TEST(Odometry, NoiseIsOfEachPoseAndDoesNotAddUp) {
  const std::vector<Pose> truth = StraightRide(2000);
  const std::vector<Pose> odometry = OdometryOf(truth, {.position_noise = 0.03, .rotation_noise = 0.002}, 5);
  double late = 0, all = 0, turned = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    const Pose error = (truth[0].inverse() * truth[i]).inverse() * odometry[i];
    const double square = error.translation().squaredNorm() / 3;
    all += square / 2000;
    if (i >= 1500) late += square / 500;
    turned += std::pow(AngleBetween(error, Pose::Identity()), 2) / 3 / 2000;
  }
  EXPECT_NEAR(std::sqrt(all), 0.03, 0.003);
  EXPECT_NEAR(std::sqrt(late), 0.03, 0.003);
  EXPECT_NEAR(std::sqrt(turned), 0.002, 0.0002);
}

}  // namespace
}  // namespace mapkeep
