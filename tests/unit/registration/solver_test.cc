#include "core/registration/solver.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>
#include <random>

namespace mapkeep {
namespace {

TEST(Solver, TheTruncatedMeanIsThatOfTheValuesThatAgree) {
  EXPECT_DOUBLE_EQ(TruncatedMean(std::vector<double>{1, 2, 3, 100}, 2), 2);
  EXPECT_DOUBLE_EQ(TruncatedMean(std::vector<double>{7}, 1), 7);
  // All three are within reach of each other's intervals, and yet leaving 0 out costs 1 instead of 2.5.
  EXPECT_DOUBLE_EQ(TruncatedMean(std::vector<double>{0, 1.9, 2.0}, 1), 1.95);
  EXPECT_NEAR(TruncatedMean(std::vector<double>{-5, 1e6, 1e6 + 1, -300}, 2), 1e6 + 0.5, 1e-6);
}

Pose Motion() {
  Pose motion = Pose::Identity();
  motion.linear() = Eigen::AngleAxisd(2.0, Eigen::Vector3d(0.1, -0.2, 1).normalized()).toRotationMatrix();
  motion.translation() = Eigen::Vector3d(120, -45, 3);
  return motion;
}

// `right` pairs that the motion made, then `wrong` ones that nothing made.
std::vector<PointPair> PairsOf(int right, int wrong, double noise) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> any(-1, 1);
  const auto point = [&](double scale) {
    return Eigen::Vector3d(scale * any(random), scale * any(random), scale * any(random));
  };
  std::vector<PointPair> pairs;
  for (int i = 0; i < right; ++i) {
    const Eigen::Vector3d source = point(30);
    pairs.push_back({source, Motion() * source + point(noise)});
  }
  for (int i = 0; i < wrong; ++i) pairs.push_back({point(30), point(30) + Motion().translation()});
  return pairs;
}

TEST(Solver, AQuarterTurnIsFoundFromTwoVectors) {
  const std::vector<PointPair> vectors = {{{1, 0, 0}, {0, 1, 0}}, {{0, 1, 0}, {-1, 0, 0}}};
  const auto rotation = SolveRotation(vectors, 0.1, 1.4);
  ASSERT_TRUE(rotation);
  EXPECT_TRUE(
      rotation->isApprox(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix(), 1e-12));
}

TEST(Solver, VectorsAlongOneLineLeaveTheRotationOpen) {
  EXPECT_FALSE(SolveRotation(std::vector<PointPair>{{{1, 0, 0}, {0, 1, 0}}, {{2, 0, 0}, {0, 2, 0}}}, 0.1, 1.4));
  EXPECT_FALSE(SolveRotation({}, 0.1, 1.4));
}

TEST(Solver, FindsTheMotionExactlyFromExactPairs) {
  const auto estimate = SolvePose(PairsOf(20, 0, 0), 0.3, 1.4);
  ASSERT_TRUE(estimate);
  EXPECT_EQ(estimate->inliers.size(), 20);
  EXPECT_TRUE(estimate->pose.isApprox(Motion(), 1e-9));
}

TEST(Solver, PairsThatNothingMadeDoNotMoveTheResult) {
  const auto estimate = SolvePose(PairsOf(100, 40, 0.1), 0.375, 1.4);
  ASSERT_TRUE(estimate);
  EXPECT_GE(estimate->inliers.size(), 98);
  EXPECT_LE(estimate->inliers.size(), 102);
  EXPECT_LT((estimate->pose.translation() - Motion().translation()).norm(), 0.05);
  EXPECT_LT(AngleBetween(estimate->pose, Motion()), 0.002);
}

TEST(Solver, RefusesWhatLeavesTheMotionOpen) {
  const auto all = PairsOf(20, 0, 0);
  EXPECT_FALSE(SolvePose({}, 0.3, 1.4));
  EXPECT_FALSE(SolvePose(std::vector<PointPair>(all.begin(), all.begin() + 2), 0.3, 1.4));
  EXPECT_FALSE(SolvePose(std::vector<PointPair>(30, all[0]), 0.3, 1.4)) << "one point thirty times";
  std::vector<PointPair> line;
  for (int i = 0; i < 30; ++i) {
    const Eigen::Vector3d source(i, 0.1 * (i % 3), 0.1 * (i % 2));
    line.push_back({source, Motion() * source});
  }
  EXPECT_FALSE(SolvePose(line, 0.3, 1.4)) << "a line: the turn about it is open";
}

}  // namespace
}  // namespace mapkeep
