#include "client/readers/kitti.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "client/readers/session_directory.h"
#include "tests/unit/client/session_files.h"

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Kitti : public ::testing::Test {
 protected:
  Kitti() { WriteKittiSession(session(), 3); }

  const std::filesystem::path& session() const { return directory_.path(); }
  std::filesystem::path Velodyne(const std::string& name) const { return session() / "velodyne" / name; }

  /// The error of opening the session or, if it opens, of reading its scans.
  std::string Error() const {
    const absl::StatusOr<SessionDirectory> opened = OpenSessionDirectory(session());
    if (!opened.ok()) return std::string(opened.status().message());
    for (size_t i = 0; i < opened->files.size(); ++i) {
      const absl::StatusOr<CheckedScan> scan = ReadScan(*opened, i);
      if (!scan.ok()) return std::string(scan.status().message());
    }
    return "no error";
  }

 private:
  TemporaryDirectory directory_;
};

TEST_F(Kitti, ReadsPointsIntensitiesAndPoses) {
  const absl::StatusOr<SessionDirectory> opened = OpenSessionDirectory(session());
  ASSERT_TRUE(opened.ok()) << opened.status();
  EXPECT_EQ(opened->layout, SessionLayout::kKitti);
  ASSERT_EQ(opened->poses.size(), 3U);
  EXPECT_EQ(opened->poses[2].translation(), Eigen::Vector3d(2, 0, 0));
  const absl::StatusOr<CheckedScan> scan = ReadScan(*opened, 1);
  ASSERT_TRUE(scan.ok()) << scan.status();
  ASSERT_EQ(scan->scan.points.size(), 3U);
  EXPECT_EQ(scan->scan.points[2], Eigen::Vector3f(3, 4, -1));
  EXPECT_THAT(scan->scan.intensities, ElementsAre(0.5F, 0.25F, 1.F));
}

TEST_F(Kitti, NumbersSortByValueHoweverManyDigits) {
  TemporaryDirectory other;
  for (const char* name : {"10.bin", "9.bin", "0011.bin", "1.bin"}) {
    WriteBin(other.path() / "velodyne" / name, {{5, 0, 0, 0}});
  }
  WriteText(other.path() / "poses.txt", kIdentityRow + kIdentityRow + kIdentityRow + kIdentityRow);
  const absl::StatusOr<SessionDirectory> opened = OpenSessionDirectory(other.path());
  ASSERT_TRUE(opened.ok()) << opened.status();
  std::vector<std::string> names;
  for (const auto& file : opened->files) names.push_back(file.filename().string());
  EXPECT_THAT(names, ElementsAre("1.bin", "9.bin", "10.bin", "0011.bin"));
}

TEST_F(Kitti, CameraPosesBecomeLidarPoses) {
  // The camera looks along the LiDAR's x: camera z is LiDAR x, camera x is LiDAR -y, camera y is LiDAR -z.
  WriteText(session() / "calib.txt", "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n");
  WriteText(session() / "poses.txt", kIdentityRow + "1 0 0 0 0 1 0 0 0 0 1 2\n" + "1 0 0 3 0 1 0 0 0 0 1 0\n");
  const absl::StatusOr<SessionDirectory> opened = OpenSessionDirectory(session());
  ASSERT_TRUE(opened.ok()) << opened.status();
  EXPECT_TRUE(opened->poses[1].translation().isApprox(Eigen::Vector3d(2, 0, 0)));
  EXPECT_TRUE(opened->poses[2].translation().isApprox(Eigen::Vector3d(0, -3, 0)));
}

TEST_F(Kitti, TimesThatDoNotCountFrom1970AreReplacedByTheOrderOfTheScans) {
  WriteText(session() / "times.txt", "1700000000.5\n1700000000.6\n1700000000.7\n");
  absl::StatusOr<SessionDirectory> opened = OpenSessionDirectory(session());
  ASSERT_TRUE(opened.ok()) << opened.status();
  EXPECT_EQ(ReadScan(*opened, 1)->scan.time, 1700000000.6);
  WriteText(session() / "times.txt", "5.0\n6.0\n7.0\n");
  opened = OpenSessionDirectory(session());
  ASSERT_TRUE(opened.ok()) << opened.status();
  EXPECT_EQ(ReadScan(*opened, 1)->scan.time, 0.1);
  EXPECT_FALSE(CountsFrom1970(ReadScan(*opened, 1)->scan.time));
}

TEST_F(Kitti, PointsAtTheSensorAreNoReturns) {
  WriteBin(Velodyne("000000.bin"), {{0, 0, 0, 0.9F}, {5, 0, 0, 0.5F}, {0.01F, 0, 0.02F, 0}, {0, 6, 0, 0.25F}});
  const absl::StatusOr<SessionDirectory> opened = OpenSessionDirectory(session());
  ASSERT_TRUE(opened.ok()) << opened.status();
  const absl::StatusOr<CheckedScan> scan = ReadScan(*opened, 0);
  ASSERT_TRUE(scan.ok()) << scan.status();
  EXPECT_THAT(scan->no_returns, ElementsAre(0U, 2U));
  EXPECT_THAT(scan->scan.intensities, ElementsAre(0.5F, 0.25F));
}

TEST_F(Kitti, IntensitiesAreScaledByWhatTheFirstScanHolds) {
  WriteBin(Velodyne("000000.bin"), {{5, 0, 0, 200}, {5, 1, 0, 51}});
  WriteBin(Velodyne("000001.bin"), {{5, 0, 0, 0.5F}, {5, 1, 0, 300}, {5, 2, 0, -1}});
  const absl::StatusOr<SessionDirectory> opened = OpenSessionDirectory(session());
  ASSERT_TRUE(opened.ok()) << opened.status();
  EXPECT_FLOAT_EQ(ReadScan(*opened, 0)->scan.intensities[1], 0.2F);
  EXPECT_THAT(ReadScan(*opened, 1)->scan.intensities, ElementsAre(0.5F / 255, 1.F, 0.F));
}

TEST_F(Kitti, AGoodSessionHasNoError) { EXPECT_EQ(Error(), "no error"); }

TEST_F(Kitti, CountsThatDoNotMatchAreNamed) {
  WriteText(session() / "poses.txt", kIdentityRow + kIdentityRow);
  EXPECT_THAT(Error(), HasSubstr("poses.txt: 2 poses for 3 scans in velodyne/"));
}

TEST_F(Kitti, TimesOfAnotherCountAreNamed) {
  WriteText(session() / "times.txt", "0.0\n0.1\n");
  EXPECT_THAT(Error(), HasSubstr("times.txt: 2 times for 3 scans"));
}

TEST_F(Kitti, AShortRowIsNamedByItsLine) {
  WriteText(session() / "poses.txt", kIdentityRow + "1 0 0 0 0 1 0 0 0 0 1\n" + kIdentityRow);
  EXPECT_THAT(Error(), HasSubstr("poses.txt:2: 11 numbers where 12 are expected"));
}

TEST_F(Kitti, AnEmptyLineInTheMiddleIsAShortRow) {
  WriteText(session() / "poses.txt", kIdentityRow + "\n" + kIdentityRow + kIdentityRow + "\n\n");
  EXPECT_THAT(Error(), HasSubstr("poses.txt:2: 0 numbers"));
}

TEST_F(Kitti, WhatIsNoNumberIsNamedByItsLine) {
  WriteText(session() / "poses.txt", kIdentityRow + kIdentityRow + "1 0 0 0 0 1 0 zero 0 0 1 0\n");
  EXPECT_THAT(Error(), HasSubstr("poses.txt:3: 'zero' is not a number"));
}

TEST_F(Kitti, APoseThatIsNotFiniteIsNamedByItsLine) {
  WriteText(session() / "poses.txt", kIdentityRow + "1 0 0 nan 0 1 0 0 0 0 1 0\n" + kIdentityRow);
  EXPECT_THAT(Error(), HasSubstr("poses.txt:2: pose value 4 of 12 is not finite"));
}

TEST_F(Kitti, ANonRotationIsNamedByItsLine) {
  WriteText(session() / "poses.txt", "2 0 0 0 0 1 0 0 0 0 1 0\n" + kIdentityRow + kIdentityRow);
  EXPECT_THAT(Error(), HasSubstr("poses.txt:1: the left 3x3 of the pose is not a rotation"));
}

TEST_F(Kitti, ABrokenCalibrationIsNamedByItsLine) {
  WriteText(session() / "calib.txt", "P0: 1 2 3\nTr: 1 0 0\n");
  EXPECT_THAT(Error(), HasSubstr("calib.txt:2: 3 numbers where 12 are expected"));
}

TEST_F(Kitti, AMissingPoseFileIsNamed) {
  std::filesystem::remove(session() / "poses.txt");
  EXPECT_THAT(Error(), HasSubstr("poses.txt: no such file"));
}

TEST_F(Kitti, AnEmptyScanIsNamed) {
  WriteBin(Velodyne("000002.bin"), {});
  EXPECT_THAT(Error(), HasSubstr("velodyne/000002.bin: the scan is empty"));
}

TEST_F(Kitti, AScanWithoutAReturnIsNamed) {
  WriteBin(Velodyne("000001.bin"), {{0, 0, 0, 0}});
  EXPECT_THAT(Error(), HasSubstr("velodyne/000001.bin: the scan holds no return"));
}

TEST_F(Kitti, ATruncatedScanIsNamed) {
  WriteText(Velodyne("000001.bin"), std::string(33, '\0'));
  EXPECT_THAT(Error(), HasSubstr("velodyne/000001.bin: truncated: 33 bytes is no multiple of 16"));
}

TEST_F(Kitti, APointThatIsNotFiniteIsNamed) {
  WriteBin(Velodyne("000001.bin"), {{5, 0, 0, 0}, {1, std::numeric_limits<float>::quiet_NaN(), 0, 0}});
  EXPECT_THAT(Error(), HasSubstr("velodyne/000001.bin: point 1 is not finite"));
}

TEST_F(Kitti, ANotFiniteIntensityIsNamed) {
  WriteBin(Velodyne("000001.bin"), {{5, 0, 0, std::numeric_limits<float>::infinity()}});
  EXPECT_THAT(Error(), HasSubstr("velodyne/000001.bin: point 0 has no finite intensity"));
}

TEST_F(Kitti, RandomBytesAreFoundOut) {
  // Every bit pattern is a float32; random ones are soon absurdly large or not finite.
  std::string bytes;
  uint32_t state = 1;
  for (int i = 0; i < 16 * 1000; ++i) {
    state = state * 1664525 + 1013904223;
    bytes += static_cast<char>(state >> 24);
  }
  WriteText(Velodyne("000001.bin"), bytes);
  EXPECT_THAT(Error(), HasSubstr("velodyne/000001.bin: point "));
}

TEST_F(Kitti, AFileThatVanishesIsNamed) {
  const absl::StatusOr<SessionDirectory> opened = OpenSessionDirectory(session());
  ASSERT_TRUE(opened.ok()) << opened.status();
  std::filesystem::remove(opened->files[2]);
  EXPECT_THAT(std::string(ReadScan(*opened, 2).status().message()), HasSubstr("velodyne/000002.bin: No such file"));
}

TEST(SessionDirectory, WhatIsNoDirectoryIsNamed) {
  EXPECT_THAT(std::string(OpenSessionDirectory("/nowhere/at-all").status().message()),
              HasSubstr("/nowhere/at-all: no such file or directory"));
}

TEST(SessionDirectory, ADirectoryThatIsNoSessionSaysWhatWasExpected) {
  const TemporaryDirectory directory;
  EXPECT_THAT(std::string(OpenSessionDirectory(directory.path()).status().message()),
              HasSubstr("expected one of velodyne/ (kitti), Scans/ (elite), pcd/ (kth), Ouster/ and"));
}

TEST(SessionDirectory, TwoLayoutsInOneAskForAChoiceAndTakeIt) {
  const TemporaryDirectory directory;
  WriteKittiSession(directory.path(), 1);
  std::filesystem::create_directory(directory.path() / "pcd");
  EXPECT_THAT(std::string(OpenSessionDirectory(directory.path()).status().message()),
              HasSubstr("say which with --format"));
  EXPECT_TRUE(OpenSessionDirectory(directory.path(), {.layout = SessionLayout::kKitti}).ok());
}

TEST(SessionDirectory, AFolderWithoutScansIsNamed) {
  const TemporaryDirectory directory;
  std::filesystem::create_directory(directory.path() / "velodyne");
  EXPECT_THAT(std::string(OpenSessionDirectory(directory.path()).status().message()),
              HasSubstr("velodyne: holds no *.bin scans"));
}

}  // namespace
}  // namespace mapkeep
