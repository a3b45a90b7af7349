#include "core/registration/fusion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/registration/pose_graph.h"
#include "tests/unit/registration/scene.h"

namespace mapkeep {
namespace {

std::vector<Pose> Drive(int scans) {
  std::vector<Pose> poses;
  for (int i = 0; i < scans; ++i) poses.push_back(MotionOf(0, {1.0 * i, 0, 0}));
  return poses;
}

TEST(BlendPoses, IsTheWeightedMean) {
  const std::array<Pose, 2> poses{MotionOf(10, {0, 0, 0}), MotionOf(20, {4, 0, 8})};
  ExpectNear({BlendPoses(poses, std::array{3.0, 1.0})}, {MotionOf(12.5, {1, 0, 2})}, 1e-9, 0.05);
  ExpectNear({BlendPoses(poses, std::array{1.0, 1.0})}, {MotionOf(15, {2, 0, 4})}, 1e-9, 1e-5);
}

TEST(FusePoses, OneWindowCarriesTheWholeSession) {
  const Pose correction = MotionOf(5, {1, 2, 3});
  std::vector<Pose> expected;
  for (const Pose& pose : Drive(20)) expected.push_back(correction * pose);
  ExpectNear(FusePoses(Drive(20), std::array{TrustedWindow{{5, 9}, correction, 0.9}}), expected, 1e-9, 1e-5);
}

TEST(FusePoses, OverlappingWindowsAreBlendedByFitnessAndPosition) {
  // Scan 5 lies in the middle of both halves' overlap: equal tapers, so fitness 0.9 against 0.8 decides.
  const std::array windows{TrustedWindow{{0, 7}, MotionOf(0, {0, 0, 0}), 0.8},
                           TrustedWindow{{3, 10}, MotionOf(0, {0, 1.7, 0}), 0.9}};
  const auto fused = FusePoses(Drive(11), windows);
  EXPECT_NEAR(fused[0].translation().y(), 0, 1e-12);
  EXPECT_NEAR(fused[5].translation().y(), 0.9, 1e-9);
  EXPECT_NEAR(fused[10].translation().y(), 1.7, 1e-12);
  for (size_t i = 1; i < fused.size(); ++i) {
    EXPECT_GE(fused[i].translation().y(), fused[i - 1].translation().y());
    EXPECT_LT(fused[i].translation().y() - fused[i - 1].translation().y(), 0.5);  // no step
  }
}

TEST(FusePoses, BetweenTrustedWindowsTheDistanceTravelledDecides) {
  const std::array windows{TrustedWindow{{0, 2}, MotionOf(0, {0, 0, 0}), 0.9},
                           TrustedWindow{{10, 12}, MotionOf(0, {0, 0.8, 0}), 0.9}};
  const auto fused = FusePoses(Drive(13), windows);
  for (int i = 2; i <= 10; ++i) EXPECT_NEAR(fused[i].translation().y(), 0.1 * (i - 2), 1e-9) << i;
}

TEST(FusePoses, ARobotThatStandsBetweenWindowsIsHalfWay) {
  std::vector<Pose> still(5, Pose::Identity());
  const std::array windows{TrustedWindow{{0, 0}, MotionOf(0, {0, 0, 0}), 0.9},
                           TrustedWindow{{4, 4}, MotionOf(0, {0, 1, 0}), 0.9}};
  EXPECT_NEAR(FusePoses(still, windows)[2].translation().y(), 0.5, 1e-9);
}

TEST(OptimisePoses, ScansThatWerePlacedTakeTheNoiseOutOfOdometry) {
  std::vector<Pose> noisy = Drive(21);
  std::vector<ScanPlacement> scans(noisy.size());
  for (size_t i = 0; i < noisy.size(); ++i) {
    const double off = i % 2 == 0 ? 0.02 : -0.02;
    scans[i] = {.pose = noisy[i], .information = 4000 * Eigen::Matrix<double, 6, 6>::Identity(), .pairs = 1000};
    noisy[i] = noisy[i] * MotionOf(0, {0, off, 0});
  }
  const std::array windows{TrustedWindow{{0, 10}, Pose::Identity(), 0.9},
                           TrustedWindow{{10, 20}, Pose::Identity(), 0.9}};
  const auto without = OptimisePoses(noisy, windows), with = OptimisePoses(noisy, windows, scans);
  double worst_without = 0, worst_with = 0;
  for (size_t i = 0; i < noisy.size(); ++i) {
    worst_without = std::max(worst_without, std::abs(without[i].translation().y()));
    worst_with = std::max(worst_with, std::abs(with[i].translation().y()));
  }
  EXPECT_GT(worst_without, 0.01) << "windows alone cannot tell";
  EXPECT_LT(worst_with, 0.5 * worst_without);
}

TEST(OptimisePoses, AScanThatMetTooLittleSaysNothing) {
  const std::vector<Pose> poses = Drive(5);
  std::vector<ScanPlacement> scans(poses.size());
  scans[2] = {.pose = MotionOf(0, {2, 1, 0}), .information = 1e6 * Eigen::Matrix<double, 6, 6>::Identity(), .pairs = 5};
  const std::array windows{TrustedWindow{{0, 4}, Pose::Identity(), 0.9}};
  ExpectNear(OptimisePoses(poses, windows, scans), poses, 1e-6, 1e-4);
}

}  // namespace
}  // namespace mapkeep
