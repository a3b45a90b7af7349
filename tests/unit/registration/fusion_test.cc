#include "core/registration/fusion.h"

#include <gtest/gtest.h>

#include <array>

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

}  // namespace
}  // namespace mapkeep
