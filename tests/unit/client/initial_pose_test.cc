#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "client/cli/arguments.h"

namespace mapkeep {
namespace {

TEST(InitialPose, IsMetresAndDegrees) {
  const auto start = ParseInitialPose("--initial-pose", "1,-2.5,3,90");
  ASSERT_TRUE(start.ok()) << start.status();
  EXPECT_EQ(start->x, 1);
  EXPECT_EQ(start->y, -2.5);
  EXPECT_EQ(start->z, 3);
  EXPECT_NEAR(start->yaw, std::numbers::pi / 2, 1e-12);
  for (const char* text : {"", "1,2,3", "1,2,3,4,5", "1,2,x,4", "1,2,nan,4"}) {
    EXPECT_THAT(std::string(ParseInitialPose("--initial-pose", text).status().message()),
                testing::HasSubstr("X,Y,Z,YAW"))
        << text;
  }
}

TEST(Gnss, IsAPlaceAndTwoDeviations) {
  const auto gnss = ParseGnss("--gnss", "500010,4600020,41.5,2,5");
  ASSERT_TRUE(gnss.ok()) << gnss.status();
  EXPECT_EQ(gnss->x, 500010);
  EXPECT_EQ(gnss->level_sigma, 2);
  EXPECT_EQ(gnss->height_sigma, 5);
  EXPECT_THAT(std::string(ParseGnss("--gnss", "1,2,3,4").status().message()), testing::HasSubstr("SIGMA_LEVEL"));
  EXPECT_THAT(std::string(ParseGnss("--gnss", "1,2,3,0,4").status().message()), testing::HasSubstr("above 0"));
}

}  // namespace
}  // namespace mapkeep
