#include "core/voxels/normal.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <random>

namespace mapkeep {
namespace {

TEST(Normal, TwoBytesKeepADirectionToWithinOneAndAHalfDegrees) {
  std::mt19937 random(1);
  std::normal_distribution<double> any;
  double worst = 0;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector3d unit = Eigen::Vector3d(any(random), any(random), any(random)).normalized();
    worst = std::max(worst, std::acos(std::min(1.0, unit.dot(DecodeNormal(EncodeNormal(unit))))));
  }
  EXPECT_LT(worst * 180 / std::numbers::pi, 1.5);
}

TEST(Normal, NoNormalStaysNone) {
  EXPECT_EQ(EncodeNormal(Eigen::Vector3d::Zero()), (std::array<uint8_t, 2>{0, 0}));
  EXPECT_TRUE(DecodeNormal({0, 0}).isZero());
}

TEST(Normal, TheAxesAreExact) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      const Eigen::Vector3d unit = sign * Eigen::Vector3d::Unit(axis);
      EXPECT_TRUE(DecodeNormal(EncodeNormal(unit)).isApprox(unit, 1e-12)) << unit.transpose();
    }
  }
}

}  // namespace
}  // namespace mapkeep
