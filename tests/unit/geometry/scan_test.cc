#include "core/geometry/scan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

std::string Complaint(const Scan& scan) { return std::string(CheckScan(scan).message()); }

TEST(Scan, BadScansAreNamedByWhatIsWrong) {
  EXPECT_THAT(Complaint({}), HasSubstr("no points"));
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(Complaint({.points = {{0, 0, 0}, {0, nan, 0}}}), HasSubstr("point 1 is not finite"));
  EXPECT_THAT(Complaint({.points = {{0, 0, 0}}, .intensities = {0, 1}}), HasSubstr("2 intensities for 1 points"));
  EXPECT_TRUE(CheckScan({.points = {{1, 2, 3}}, .intensities = {0.5}}).ok());
}

TEST(Scan, ASourceOverMemoryGivesTheSameScansAgainAndAgain) {
  const ScanSource source = SourceOf({{.points = {{1, 2, 3}}}, {.points = {{4, 5, 6}}}});
  ASSERT_EQ(source.count, 2U);
  for (int round = 0; round < 2; ++round) {
    EXPECT_EQ(source.read(1)->points[0], Eigen::Vector3f(4, 5, 6));
    EXPECT_EQ(source.read(0)->points[0], Eigen::Vector3f(1, 2, 3));
  }
}

}  // namespace
}  // namespace mapkeep
