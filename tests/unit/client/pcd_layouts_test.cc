// The layouts elite and kth, whose scans are PCD files; they are written here by PCL itself.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pcl/io/pcd_io.h>
#include <pcl/point_types.h>

#include <limits>
#include <string>

#include "client/readers/session_directory.h"
#include "tests/unit/client/session_files.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

using ::testing::ElementsAre;
using ::testing::HasSubstr;

enum class Encoding { kAscii, kBinary, kCompressed };

using Cloud = pcl::PointCloud<pcl::PointXYZI>;

void WritePcd(const fs::path& file, const Cloud& cloud, Encoding encoding) {
  fs::create_directories(file.parent_path());
  pcl::PCDWriter writer;
  switch (encoding) {
    case Encoding::kAscii:
      ASSERT_EQ(writer.writeASCII(file.string(), cloud), 0);
      break;
    case Encoding::kBinary:
      ASSERT_EQ(writer.writeBinary(file.string(), cloud), 0);
      break;
    case Encoding::kCompressed:
      ASSERT_EQ(writer.writeBinaryCompressed(file.string(), cloud), 0);
      break;
  }
}

Cloud CloudOf(std::initializer_list<pcl::PointXYZI> points) {
  Cloud cloud;
  for (const pcl::PointXYZI& point : points) cloud.push_back(point);
  return cloud;
}

class PcdEncoding : public ::testing::TestWithParam<Encoding> {};

INSTANTIATE_TEST_SUITE_P(All, PcdEncoding,
                         ::testing::Values(Encoding::kAscii, Encoding::kBinary, Encoding::kCompressed));

TEST_P(PcdEncoding, EliteScansAreInTheSensorFrame) {
  const TemporaryDirectory directory;
  WritePcd(directory.path() / "Scans/000000.pcd", CloudOf({{5, 1, 2, 0.5F}, {-3, 0.25F, 1, 1.F}}), GetParam());
  WriteText(directory.path() / "poses.txt", "1 0 0 7 0 1 0 0 0 0 1 0\n");
  const absl::StatusOr<SessionDirectory> opened = OpenSessionDirectory(directory.path());
  ASSERT_TRUE(opened.ok()) << opened.status();
  EXPECT_EQ(opened->layout, SessionLayout::kElite);
  EXPECT_EQ(opened->poses[0].translation().x(), 7);
  const absl::StatusOr<CheckedScan> scan = ReadScan(*opened, 0);
  ASSERT_TRUE(scan.ok()) << scan.status();
  ASSERT_EQ(scan->scan.points.size(), 2U);
  EXPECT_EQ(scan->scan.points[1], Eigen::Vector3f(-3, 0.25F, 1));
  EXPECT_THAT(scan->scan.intensities, ElementsAre(0.5F, 1.F));
}

TEST_P(PcdEncoding, KthPointsComeBackToTheSensorThatViewpointTells) {
  // The sensor stands at (10, 20, 1) and has turned left by 90 degrees: what it sees 5 m ahead is at (10, 25, 1).
  const TemporaryDirectory directory;
  Cloud cloud = CloudOf({{10, 25, 1, 0.5F}, {12, 20, 1, 0.25F}});
  cloud.sensor_origin_ = Eigen::Vector4f(10, 20, 1, 0);
  cloud.sensor_orientation_ = Eigen::Quaternionf(Eigen::AngleAxisf(M_PI_2, Eigen::Vector3f::UnitZ()));
  WritePcd(directory.path() / "pcd/000000.pcd", cloud, GetParam());
  const absl::StatusOr<SessionDirectory> opened = OpenSessionDirectory(directory.path());
  ASSERT_TRUE(opened.ok()) << opened.status();
  EXPECT_EQ(opened->layout, SessionLayout::kKth);
  EXPECT_TRUE(opened->poses[0].translation().isApprox(Eigen::Vector3d(10, 20, 1)));
  const absl::StatusOr<CheckedScan> scan = ReadScan(*opened, 0);
  ASSERT_TRUE(scan.ok()) << scan.status();
  EXPECT_TRUE(scan->scan.points[0].isApprox(Eigen::Vector3f(5, 0, 0), 1e-5F)) << scan->scan.points[0];
  EXPECT_TRUE(scan->scan.points[1].isApprox(Eigen::Vector3f(0, -2, 0), 1e-5F)) << scan->scan.points[1];
}

class Elite : public ::testing::Test {
 protected:
  Elite() { WriteText(session() / "poses.txt", kIdentityRow); }

  const fs::path& session() const { return directory_.path(); }
  fs::path ScanFile() const { return session() / "Scans/000000.pcd"; }

  absl::StatusOr<CheckedScan> Read() const {
    const absl::StatusOr<SessionDirectory> opened = OpenSessionDirectory(session());
    if (!opened.ok()) return opened.status();
    return ReadScan(*opened, 0);
  }
  std::string Error() const { return std::string(Read().status().message()); }

 private:
  TemporaryDirectory directory_;
};

TEST_F(Elite, PointsOfNansAreNoReturns) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  WritePcd(ScanFile(), CloudOf({{nan, nan, nan, 0}, {5, 0, 0, 1}}), Encoding::kBinary);
  const absl::StatusOr<CheckedScan> scan = Read();
  ASSERT_TRUE(scan.ok()) << scan.status();
  EXPECT_THAT(scan->no_returns, ElementsAre(0U));
  EXPECT_EQ(scan->scan.points.size(), 1U);
}

TEST_F(Elite, APointThatIsPartlyNanIsAnError) {
  WritePcd(ScanFile(), CloudOf({{5, 0, 0, 1}, {1, std::numeric_limits<float>::quiet_NaN(), 1, 0}}), Encoding::kBinary);
  EXPECT_THAT(Error(), HasSubstr("Scans/000000.pcd: point 1 is not finite"));
}

TEST_F(Elite, AMissingIntensityIsUnknown) {
  WriteText(ScanFile(),
            "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\n"
            "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n5 6 7\n");
  const absl::StatusOr<CheckedScan> scan = Read();
  ASSERT_TRUE(scan.ok()) << scan.status();
  EXPECT_EQ(scan->scan.points[0], Eigen::Vector3f(5, 6, 7));
  EXPECT_TRUE(scan->scan.intensities.empty());
}

TEST_F(Elite, DoublesAndWholeNumbersAreReadToo) {
  WriteText(ScanFile(),
            "VERSION 0.7\nFIELDS x y z intensity\nSIZE 8 8 8 2\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 2\n"
            "HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ascii\n5 6 7 65535\n1 2 3 0\n");
  const absl::StatusOr<CheckedScan> scan = Read();
  ASSERT_TRUE(scan.ok()) << scan.status();
  EXPECT_EQ(scan->scan.points[0], Eigen::Vector3f(5, 6, 7));
  EXPECT_THAT(scan->scan.intensities, ElementsAre(1.F, 0.F));
}

TEST_F(Elite, AFileThatIsNoPcdIsNamed) {
  WriteText(ScanFile(), "no cloud at all");
  EXPECT_THAT(Error(), HasSubstr("Scans/000000.pcd: not a readable PCD file"));
}

TEST_F(Elite, AnEmptyFileIsNamed) {
  WriteText(ScanFile(), "");
  EXPECT_THAT(Error(), HasSubstr("Scans/000000.pcd: "));
}

TEST_F(Elite, ATruncatedBinaryFileIsNamed) {
  WritePcd(ScanFile(), CloudOf({{5, 0, 0, 1}, {6, 0, 0, 1}}), Encoding::kBinary);
  fs::resize_file(ScanFile(), fs::file_size(ScanFile()) - 5);
  EXPECT_THAT(Error(), HasSubstr("Scans/000000.pcd: truncated"));
}

TEST_F(Elite, ATruncatedCompressedFileIsNamed) {
  Cloud cloud;
  for (int i = 0; i < 1000; ++i) cloud.push_back({5 + 0.01F * static_cast<float>(i), 0.3F, 1, 1});
  WritePcd(ScanFile(), cloud, Encoding::kCompressed);
  fs::resize_file(ScanFile(), fs::file_size(ScanFile()) / 2);
  EXPECT_THAT(Error(), HasSubstr("Scans/000000.pcd: "));
}

TEST_F(Elite, AHeaderThatClaimsBillionsOfPointsAllocatesNothing) {
  WriteText(ScanFile(),
            "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4000000000\nHEIGHT 1\n"
            "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4000000000\nDATA binary\n");
  EXPECT_THAT(Error(), HasSubstr("Scans/000000.pcd: 4000000000 points, more than the 4000000 a scan may hold"));
}

TEST_F(Elite, SizesThatContradictEachOtherAreNamed) {
  const auto header = [](const std::string& size, const std::string& count, const std::string& width) {
    return "VERSION 0.7\nFIELDS x y z\nSIZE " + size + "\nTYPE F F F\nCOUNT " + count + "\nWIDTH " + width +
           "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n5 6 7\n";
  };
  WriteText(ScanFile(), header("4 4", "1 1 1", "1"));
  EXPECT_THAT(Error(), HasSubstr("SIZE has 2 values where 3 are expected"));
  WriteText(ScanFile(), header("4 4 -4", "1 1 1", "1"));
  EXPECT_THAT(Error(), HasSubstr("SIZE: '-4' is not a count"));
  WriteText(ScanFile(), header("4 4 3", "1 1 1", "1"));
  EXPECT_THAT(Error(), HasSubstr("field 'z' of type F, size 3 and count 1 is not known"));
  WriteText(ScanFile(), header("4 4 4", "1 1 4000000000", "1"));
  EXPECT_THAT(Error(), HasSubstr("field 'z' of type F, size 4 and count 4000000000 is not known"));
  WriteText(ScanFile(), header("4 4 4", "1 1 1", "2"));
  EXPECT_THAT(Error(), HasSubstr("WIDTH 2 times HEIGHT 1 is not POINTS 1"));
}

TEST_F(Elite, TooFewLinesOfPointsAreNamed) {
  WriteText(ScanFile(),
            "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\n"
            "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ascii\n5 6 7\n");
  EXPECT_THAT(Error(), HasSubstr("Scans/000000.pcd: truncated: 1 points where 2 are announced"));
}

TEST_F(Elite, APointWithTooFewNumbersOrNoneIsNamed) {
  const std::string header =
      "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\n"
      "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ascii\n5 6 7\n";
  WriteText(ScanFile(), header + "8 9\n");
  EXPECT_THAT(Error(), HasSubstr("Scans/000000.pcd: point 1 has 2 values where 3 are expected"));
  WriteText(ScanFile(), header + "8 nine 10\n");
  EXPECT_THAT(Error(), HasSubstr("Scans/000000.pcd: point 1: y 'nine' is not a number"));
}

TEST_F(Elite, CompressedPointsThatAreDamagedAreNamed) {
  const std::string header =
      "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\n"
      "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA binary_compressed\n";
  // Two bytes, which refer back to before the beginning.
  WriteText(ScanFile(), header + std::string("\x02\0\0\0\x0c\0\0\0\x20\x00", 10));
  EXPECT_THAT(Error(), HasSubstr("Scans/000000.pcd: its points cannot be read: the compressed bytes are damaged"));
  WriteText(ScanFile(), header + std::string("\0\0\0\0\x0c\0\0\0", 8));
  EXPECT_THAT(Error(), HasSubstr("Scans/000000.pcd: 0 compressed bytes cannot hold 12 bytes of points"));
}

TEST_F(Elite, AHeaderLineThatNobodyKnowsIsNamed) {
  WriteText(ScanFile(),
            "VER\x01SION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\n"
            "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n5 6 7\n");
  EXPECT_THAT(Error(), HasSubstr("its header has a line 'VER\\x01SION'"));
}

TEST_F(Elite, ACloudWithoutCoordinatesIsNamed) {
  WriteText(ScanFile(),
            "VERSION 0.7\nFIELDS a b\nSIZE 4 4\nTYPE F F\nCOUNT 1 1\nWIDTH 1\nHEIGHT 1\n"
            "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n5 6\n");
  EXPECT_THAT(Error(), HasSubstr("Scans/000000.pcd: has no fields x, y and z"));
}

TEST(Kth, AViewpointThatIsNoRotationIsNamed) {
  const TemporaryDirectory directory;
  WriteText(directory.path() / "pcd/7.pcd",
            "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\n"
            "VIEWPOINT 0 0 0 2 0 0 0\nPOINTS 1\nDATA ascii\n5 6 7\n");
  EXPECT_THAT(std::string(OpenSessionDirectory(directory.path()).status().message()),
              HasSubstr("pcd/7.pcd: VIEWPOINT is not a rotation: its quaternion has length 2"));
}

}  // namespace
}  // namespace mapkeep
