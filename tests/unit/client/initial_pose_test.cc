#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <vector>

#include "client/cli/arguments.h"

namespace mapkeep {
namespace {

TEST(InitialPose, IsMetresAndDegrees) {
  const auto start = ParseInitialPose("--initial-pose", "1,-2.5,3,90");
  ASSERT_TRUE(start.ok()) << start.status();
  EXPECT_EQ(start->position, Eigen::Vector3d(1, -2.5, 3));
  EXPECT_NEAR(start->yaw, std::numbers::pi / 2, 1e-12);
  for (const char* text : {"", "1,2,3", "1,2,3,4,5", "1,2,x,4", "1,2,nan,4"}) {
    EXPECT_THAT(std::string(ParseInitialPose("--initial-pose", text).status().message()),
                testing::HasSubstr("X,Y,Z,YAW"))
        << text;
  }
}

TEST(InitialPose, MovesTheTrajectoryAndKeepsItsShapeAndTilt) {
  const Pose tilt(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY()));
  std::vector<Pose> poses = {Eigen::Translation3d(5, 5, 1) * tilt, Eigen::Translation3d(6, 5, 1) * tilt};
  const Pose step = poses[0].inverse() * poses[1];
  BeginAt({.position = {10, 0, 2}, .yaw = std::numbers::pi / 2}, poses);
  EXPECT_TRUE(poses[0].translation().isApprox(Eigen::Vector3d(10, 0, 2), 1e-12));
  EXPECT_TRUE(poses[1].translation().isApprox(Eigen::Vector3d(10, 1, 2), 1e-12)) << "a step ahead now leads along y";
  EXPECT_TRUE((poses[0].inverse() * poses[1]).isApprox(step, 1e-12));
  EXPECT_NEAR(poses[0].linear()(2, 0), tilt.linear()(2, 0), 1e-12);
}

}  // namespace
}  // namespace mapkeep
