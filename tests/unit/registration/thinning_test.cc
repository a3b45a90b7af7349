#include "core/registration/thinning.h"

#include <gtest/gtest.h>

#include <limits>

namespace mapkeep {
namespace {

TEST(ThinPoints, GivesTheMeanOfEachVoxelInTheOrderTheyOccur) {
  const std::vector<Eigen::Vector3d> points{{5.1, 0, 0}, {-0.1, 0, 0}, {5.3, 0.2, 0}, {0.1, 0, 0}};
  const auto thinned = ThinPoints(points, 1.0);
  ASSERT_EQ(thinned.size(), 3U);
  EXPECT_TRUE(thinned[0].isApprox(Eigen::Vector3d(5.2, 0.1, 0)));
  EXPECT_TRUE(thinned[1].isApprox(Eigen::Vector3d(-0.1, 0, 0)));
  EXPECT_TRUE(thinned[2].isApprox(Eigen::Vector3d(0.1, 0, 0)));
}

TEST(ThinPoints, LeavesOutWhatHasNoPlace) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(ThinPoints(std::vector<Eigen::Vector3d>{{nan, 0, 0}, {0, inf, 0}, {0, 0, -1e9}}, 0.3).empty());
  EXPECT_TRUE(ThinPoints(std::vector<Eigen::Vector3d>{}, 0.3).empty());
}

}  // namespace
}  // namespace mapkeep
