#include "core/geometry/pose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numbers>

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

TEST(Pose, ComesBackFromItsRows) {
  const Pose pose = Eigen::Translation3d(1, -2, 3) * Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized());
  const auto again = PoseFromRows(RowsOf(pose));
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_TRUE(again->isApprox(pose, 1e-12));
}

TEST(Pose, RowsThatAreNotARotationAreRefusedWithTheirError) {
  const auto message = [](const PoseRows& rows) { return std::string(PoseFromRows(rows).status().message()); };
  EXPECT_THAT(message({2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}), HasSubstr("not a rotation"));
  EXPECT_THAT(message({-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}), HasSubstr("reflection"));
  EXPECT_THAT(message({1, 0, 0, std::numeric_limits<double>::quiet_NaN(), 0, 1, 0, 0, 0, 0, 1, 0}),
              HasSubstr("value 4 of 12 is not finite"));
}

TEST(Pose, AngleBetweenIsTheAngleThatLeadsFromOneToTheOther) {
  const Pose a = Pose(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()));
  const Pose b =
      Eigen::Translation3d(5, 0, 0) * Eigen::AngleAxisd(0.3 - std::numbers::pi / 2, Eigen::Vector3d::UnitZ());
  EXPECT_NEAR(AngleBetween(a, b), std::numbers::pi / 2, 1e-12);
  EXPECT_EQ(AngleBetween(a, a), 0);
}

}  // namespace
}  // namespace mapkeep
