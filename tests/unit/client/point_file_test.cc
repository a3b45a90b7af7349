#include "client/exporters/point_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pcl/io/pcd_io.h>
#include <pcl/io/ply_io.h>
#include <pcl/point_types.h>
#include <unistd.h>

#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/unit/client/session_files.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

using ::testing::HasSubstr;

using Cloud = pcl::PointCloud<pcl::PointXYZI>;

/// Writes `count` points (i, -i / 2, i / 4) with intensities of i / 1000.
void WritePoints(const fs::path& path, CoordinateType coordinates, int count) {
  absl::StatusOr<PointFileWriter> writer = PointFileWriter::Create(path, coordinates, {"map street epoch 3"});
  ASSERT_TRUE(writer.ok()) << writer.status();
  for (int i = 0; i < count; ++i) {
    const double x = i;
    writer->Add({x, -x / 2, x / 4}, static_cast<float>(i) / 1000);
  }
  EXPECT_EQ(writer->count(), static_cast<uint64_t>(count));
  const absl::Status finished = writer->Finish();
  ASSERT_TRUE(finished.ok()) << finished;
}

void ExpectPoints(const Cloud& cloud, size_t count) {
  ASSERT_EQ(cloud.size(), count);
  for (size_t i = 0; i < count; ++i) {
    const auto x = static_cast<float>(i);
    EXPECT_EQ(cloud[i].getVector3fMap(), Eigen::Vector3f(x, -x / 2, x / 4));
    EXPECT_EQ(cloud[i].intensity, x / 1000);
  }
}

std::string Contents(const fs::path& path) {
  std::ostringstream contents;
  contents << std::ifstream(path, std::ios::binary).rdbuf();
  return contents.str();
}

size_t FilesIn(const fs::path& directory) {
  return static_cast<size_t>(std::distance(fs::directory_iterator(directory), fs::directory_iterator()));
}

class PointFile : public ::testing::TestWithParam<int> {};

// Counts of one digit and of several, so that the padded header is tried in both.
INSTANTIATE_TEST_SUITE_P(Counts, PointFile, ::testing::Values(1, 9, 10, 12345));

TEST_P(PointFile, PclReadsThePcdBack) {
  const TemporaryDirectory directory;
  const fs::path path = directory.path() / "map.pcd";
  WritePoints(path, CoordinateType::kFloat32, GetParam());
  Cloud cloud;
  ASSERT_EQ(pcl::io::loadPCDFile(path.string(), cloud), 0);
  ExpectPoints(cloud, GetParam());
  EXPECT_EQ(cloud.sensor_origin_.head<3>(), Eigen::Vector3f::Zero());
  EXPECT_TRUE(cloud.sensor_orientation_.isApprox(Eigen::Quaternionf::Identity()));
}

TEST_P(PointFile, PclReadsThePlyBack) {
  const TemporaryDirectory directory;
  const fs::path path = directory.path() / "map.ply";
  WritePoints(path, CoordinateType::kFloat32, GetParam());
  Cloud cloud;
  ASSERT_EQ(pcl::io::loadPLYFile(path.string(), cloud), 0);
  ExpectPoints(cloud, GetParam());
}

TEST(PointFile, Float64KeepsMillimetresFarFromZero) {
  const TemporaryDirectory directory;
  const Eigen::Vector3d utm(456789.123, 5412345.678, 101.002);
  for (const char* name : {"map.pcd", "map.ply"}) {
    const fs::path path = directory.path() / name;
    absl::StatusOr<PointFileWriter> writer = PointFileWriter::Create(path, CoordinateType::kFloat64);
    ASSERT_TRUE(writer.ok()) << writer.status();
    writer->Add(utm, 0.5F);
    ASSERT_TRUE(writer->Finish().ok());
    // One row of three doubles and a float ends the file.
    const std::string contents = Contents(path);
    constexpr size_t kRow = 3 * sizeof(double) + sizeof(float);
    ASSERT_GT(contents.size(), kRow);
    Eigen::Vector3d read;
    std::memcpy(read.data(), contents.data() + contents.size() - kRow, 3 * sizeof(double));
    EXPECT_EQ(read, utm) << name;
    EXPECT_THAT(contents, HasSubstr(std::string(name) == "map.pcd" ? "SIZE 8 8 8 4" : "property double x"));
  }
}

TEST(PointFile, CommentsStandInTheHeader) {
  const TemporaryDirectory directory;
  WritePoints(directory.path() / "map.pcd", CoordinateType::kFloat32, 1);
  WritePoints(directory.path() / "map.ply", CoordinateType::kFloat32, 1);
  EXPECT_THAT(Contents(directory.path() / "map.pcd"), HasSubstr("\n# map street epoch 3\n"));
  EXPECT_THAT(Contents(directory.path() / "map.ply"), HasSubstr("\ncomment map street epoch 3\n"));
}

TEST(PointFile, AnEmptyMapIsAFileWithoutPoints) {
  const TemporaryDirectory directory;
  WritePoints(directory.path() / "map.pcd", CoordinateType::kFloat32, 0);
  EXPECT_THAT(Contents(directory.path() / "map.pcd"), HasSubstr("POINTS 0\nDATA binary\n"));
}

TEST(PointFile, AnExportThatEndsEarlyLeavesTheOldFileAndNothingElse) {
  const TemporaryDirectory directory;
  const fs::path path = directory.path() / "map.pcd";
  WriteText(path, "the old map");
  {
    absl::StatusOr<PointFileWriter> writer = PointFileWriter::Create(path, CoordinateType::kFloat32);
    ASSERT_TRUE(writer.ok()) << writer.status();
    writer->Add({1, 2, 3}, 0);
  }
  EXPECT_EQ(Contents(path), "the old map");
  EXPECT_EQ(FilesIn(directory.path()), 1U);
}

TEST(PointFile, AFullDiskIsAnErrorAndLeavesNothing) {
  // /dev/full takes no byte; the writer's temporary name is beside its target, so a link leads there.
  const TemporaryDirectory directory;
  const fs::path path = directory.path() / "map.pcd";
  fs::create_symlink("/dev/full", path.string() + "." + std::to_string(getpid()) + ".partial");
  absl::StatusOr<PointFileWriter> writer = PointFileWriter::Create(path, CoordinateType::kFloat32);
  ASSERT_TRUE(writer.ok()) << writer.status();
  for (int i = 0; i < 100000; ++i) writer->Add({1, 2, 3}, 0);
  EXPECT_THAT(std::string(writer->Finish().message()), HasSubstr("map.pcd: cannot be written"));
  EXPECT_FALSE(fs::exists(path));
}

TEST(PointFile, ADirectoryThatIsNotThereIsNamed) {
  EXPECT_THAT(
      std::string(PointFileWriter::Create("/nowhere/at-all/map.pcd", CoordinateType::kFloat32).status().message()),
      HasSubstr("/nowhere/at-all/map.pcd: cannot be written: No such file or directory"));
}

TEST(PointFile, OtherExtensionsAreRefused) {
  for (const char* name : {"map.las", "map", "pcd", "map.PCD"}) {
    EXPECT_THAT(std::string(PointFileFormatOf(name).status().message()), HasSubstr("ends in .pcd or .ply")) << name;
  }
}

}  // namespace
}  // namespace mapkeep
