#include "client/cli/arguments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

TEST(Arguments, APointIsThreeNumbers) {
  EXPECT_EQ(*ParsePoint("--origin", "1,-2.5,3e3"), Eigen::Vector3d(1, -2.5, 3000));
  for (const char* text : {"", "1,2", "1,2,3,4", "1,2,", "1,2,x", "1,2,nan", "1,2,inf", "1;2;3"}) {
    EXPECT_THAT(std::string(ParsePoint("--origin", text).status().message()), HasSubstr("--origin")) << text;
  }
}

TEST(Arguments, ABoxIsSixNumbersWithEveryMinBelowItsMax) {
  const auto box = ParseBox("--box", "-1,-2,-3,4,5,6");
  ASSERT_TRUE(box.ok()) << box.status();
  EXPECT_EQ(box->min(), Eigen::Vector3d(-1, -2, -3));
  EXPECT_EQ(box->max(), Eigen::Vector3d(4, 5, 6));
  EXPECT_THAT(std::string(ParseBox("--box", "0,0,0,1,0,1").status().message()), HasSubstr("below its MAX"));
  EXPECT_THAT(std::string(ParseBox("--box", "0,0,0,1,1").status().message()), HasSubstr("MINX,MINY"));
}

TEST(Arguments, ASessionIdIsTheDirectorysNameMadeFitAndAChecksum) {
  EXPECT_EQ(SessionIdFrom("drive-0005", 0xabc), "drive-0005-00000abc");
  EXPECT_EQ(SessionIdFrom(".hidden dir/ü", 1), "hidden-dir----00000001");
  EXPECT_EQ(SessionIdFrom("", 1), "session-00000001");
  EXPECT_EQ(SessionIdFrom(std::string(500, 'a'), 1).size(), 128U);
}

}  // namespace
}  // namespace mapkeep
