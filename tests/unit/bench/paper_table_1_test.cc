// Table 1 of the paper on two simulated sessions.

#include "tests/bench/paper_table_1.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "client/simulator/session_files.h"
#include "client/simulator/street_session.h"
#include "tests/unit/client/session_files.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

TEST(DistanceBetween, IsWorkedOutByHandOnFourPoints) {
  const std::vector<Eigen::Vector3d> first{{0, 0, 0}, {10, 0, 0}, {20, 0, 0}};
  const std::vector<Eigen::Vector3d> second{{0.3, 0, 0}, {10, 0.4, 0}, {30, 0, 0}, {40, 0, 0}};
  const MapDistance distance = DistanceBetween(first, second);
  EXPECT_EQ(distance.inliers, 2U) << "the other two have nothing within 0.5 m";
  EXPECT_DOUBLE_EQ(distance.share, 0.5);
  EXPECT_NEAR(distance.rmse, std::sqrt((0.09 + 0.16) / 2), 1e-12);
  EXPECT_NEAR(distance.chamfer, 0.35, 1e-12) << "the same two pairs both ways";
}

TEST(DistanceBetween, MapsWithoutPointsHaveNone) {
  const std::vector<Eigen::Vector3d> one{{0, 0, 0}};
  EXPECT_EQ(DistanceBetween(one, {}).inliers, 0U);
  EXPECT_EQ(DistanceBetween({}, one).inliers, 0U);
}

// Two days of a street, each in its own odometry frame and in a layout of its own.
TEST(PaperTable1, TwoSessionsGiveBothOfOurRowsBesideThePapers) {
  const TemporaryDirectory directory;
  const auto street = MakeStreet({.seed = 3, .streets = 1, .change_rate = 0.3});
  ASSERT_TRUE(street.ok()) << street.status();
  for (const int day : {0, 1}) {
    DriveParameters drive{.sensor = *SensorNamed("vlp16"), .scans = 40, .speed = 20, .start = 4.0 * day};
    drive.odometry.drift = 0.3;
    const auto session = DriveThrough(*street, day, drive);
    ASSERT_TRUE(session.ok()) << session.status();
    ASSERT_TRUE(WriteSession(*session, directory.path() / (day == 0 ? "first" : "second"),
                             day == 0 ? SessionLayout::kKitti : SessionLayout::kElite)
                    .ok());
  }
  const auto rows = RowsOfSessions(directory.path() / "first", directory.path() / "second");
  ASSERT_TRUE(rows.ok()) << rows.status();
  ASSERT_EQ(rows->size(), 2U);
  for (const AlignmentRow& row : *rows) {
    ASSERT_TRUE(row.aligned) << row.method << ": " << row.reason;
    EXPECT_GT(row.distance.share, 0.7) << row.method;
    EXPECT_LT(row.distance.rmse, 0.2) << row.method;
    EXPECT_GT(row.distance.chamfer, 0) << row.method;
    EXPECT_LT(row.distance.chamfer, 0.2) << row.method;
    EXPECT_GT(row.seconds, 0) << row.method;
  }
  const std::string text = PrintedTable1("first, second", *rows);
  EXPECT_THAT(text, HasSubstr("ELite++ (paper)"));
  EXPECT_THAT(text, HasSubstr("Mapkeep, eq. 2"));
}

TEST(PaperTable1, AFolderThatIsNoSessionIsNamed) {
  const TemporaryDirectory directory;
  const auto rows = RowsOfSessions(directory.path() / "nowhere", directory.path());
  ASSERT_FALSE(rows.ok());
  EXPECT_THAT(std::string(rows.status().message()), HasSubstr("nowhere"));
}

}  // namespace
}  // namespace mapkeep
