#include "core/registration/descriptors.h"

#include <gtest/gtest.h>

#include <random>

namespace mapkeep {
namespace {

const Eigen::Vector3f kUp = Eigen::Vector3f::UnitZ();

TEST(Descriptors, TwoPointsOfAPlaneFallInTheMiddleBins) {
  EXPECT_EQ(BinsOfPair(Eigen::Vector3f::UnitX(), kUp, kUp), (PairBins{5, 5, 5}));
}

// The line rises at 45 degrees from a floor to a wall that faces back: u = z, so phi = cos 45 = 0.71 and theta is the
// angle of the wall's normal -x in the frame (u, w = x): -90 degrees; nothing turns out of the plane, so alpha = 0.
TEST(Descriptors, AFloorAndAWallFallWhereGeometrySays) {
  const Eigen::Vector3f line = Eigen::Vector3f(1, 0, 1).normalized();
  EXPECT_EQ(BinsOfPair(line, kUp, -Eigen::Vector3f::UnitX()), (PairBins{5, 9, 2}));
}

TEST(Descriptors, InsideAndOutsideCornersDiffer) {
  const Eigen::Vector3f line = Eigen::Vector3f(1, 0, 1).normalized();
  EXPECT_NE(BinsOfPair(line, kUp, -Eigen::Vector3f::UnitX()), BinsOfPair(line, -kUp, Eigen::Vector3f::UnitX()));
}

TEST(Descriptors, BothPointsOfAPairSeeTheSameBins) {
  std::mt19937 random(1);
  std::normal_distribution<float> any;
  const auto unit = [&] { return Eigen::Vector3f(any(random), any(random), any(random)).normalized(); };
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3f line = unit();
    const Eigen::Vector3f first = unit();
    const Eigen::Vector3f second = unit();
    EXPECT_EQ(BinsOfPair(line, first, second), BinsOfPair(-line, second, first));
  }
}

TEST(Descriptors, ALineAlongTheNormalHasBinsToo) {
  const PairBins bins = BinsOfPair(kUp, kUp, kUp);
  EXPECT_EQ(bins.alpha, 5);
  EXPECT_EQ(bins.phi, kFeatureBins - 1);
}

// A flat square of one point a voxel, its normals given.
MatchCloud Square(int edge) {
  FacingPoints input;
  for (int x = 0; x < edge; ++x) {
    for (int y = 0; y < edge; ++y) {
      input.points.emplace_back(0.5 * x + 0.25, 0.5 * y + 0.25, 0.25);
      input.facing.emplace_back(0, 0, 1);
    }
  }
  return MakeMatchCloud(input, 0.5, 3);
}

TEST(Descriptors, APlanePutsAllPairsInTheMiddleBins) {
  const auto descriptors = DescribePoints(Square(12), 5);
  ASSERT_EQ(descriptors.size(), 144);
  Descriptor flat{};
  flat[5] = flat[16] = flat[27] = 255;
  for (const Descriptor& descriptor : descriptors) {
    EXPECT_EQ(descriptor, flat);
    EXPECT_EQ(FlatnessOf(descriptor), 1);
  }
}

// Three points: pairs (0,1) in the middle bins, (0,2) and (1,2) from floor to wall. The point's own histogram and the
// weighted mean of its neighbours' count half each.
TEST(Descriptors, WeighNeighboursByInverseSquaredDistance) {
  MatchCloud cloud{.voxel_size = 1};
  cloud.points = {{0, 0, 0}, {1, 0, 0}, {2, 0, 1}};
  cloud.normals = {kUp, kUp, -Eigen::Vector3f::UnitX()};
  cloud.cell_begin = {0, 3};
  cloud.cell_keys = {uint64_t{1} << 56};
  const PairBins near = BinsOfPair(Eigen::Vector3f(1, 0, 1).normalized(), kUp, cloud.normals[2]);
  const PairBins far = BinsOfPair(Eigen::Vector3f(2, 0, 1).normalized(), kUp, cloud.normals[2]);
  ASSERT_NE(near.phi, far.phi);
  ASSERT_NE(near.phi, 5);
  ASSERT_NE(far.phi, 5);
  const Descriptor descriptor = DescribePoints(cloud, 5)[0];
  // Simple histograms of phi, as shares: point 0 {middle 1/2, far 1/2}, point 1 {middle 1/2, near 1/2}, point 2
  // {near 1/2, far 1/2}. Neighbours of 0: point 1 at distance 1 (weight 1), point 2 at sqrt 5 (weight 1/5).
  const double from_one = 1 / 1.2;
  const double from_two = 0.2 / 1.2;
  const int middle = static_cast<int>(255 * (0.5 + from_one * 0.5) / 2 + 0.5);
  const int near_bin = static_cast<int>(255 * (from_one * 0.5 + from_two * 0.5) / 2 + 0.5);
  const int far_bin = static_cast<int>(255 * (0.5 + from_two * 0.5) / 2 + 0.5);
  EXPECT_EQ(descriptor[kFeatureBins + 5], middle);
  EXPECT_EQ(descriptor[kFeatureBins + near.phi], near_bin);
  EXPECT_EQ(descriptor[kFeatureBins + far.phi], far_bin);
}

TEST(Descriptors, APointAloneIsDescribedByNothingAndCountsAsFlat) {
  MatchCloud cloud{.voxel_size = 1};
  cloud.points = {{0, 0, 0}};
  cloud.normals = {kUp};
  cloud.cell_begin = {0, 1};
  cloud.cell_keys = {uint64_t{1} << 56};
  const auto descriptors = DescribePoints(cloud, 5);
  EXPECT_EQ(descriptors[0], Descriptor{});
  EXPECT_EQ(FlatnessOf(descriptors[0]), 1);
}

}  // namespace
}  // namespace mapkeep
