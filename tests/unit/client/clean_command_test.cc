// `mapkeep clean` on a small session: a wall behind a car that drives away.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pcl/io/pcd_io.h>
#include <pcl/point_types.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/unit/client/program.h"
#include "tests/unit/client/session_files.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr int kScans = 20;
constexpr float kWallX = 12;
constexpr float kCarX = 6;
constexpr int kNoReturns = 1;

/// A ray from the sensor to (1, y, z) reaches the car in the first three scans and the wall after that.
bool MeetsTheCar(float y, float z) { return std::abs(y) < 0.12F && z > -0.15F && z < 0.05F; }

/// The scans of a sensor at rest: one no-return, then a grid of rays.
std::vector<PointRow> ScanNumber(int scan) {
  std::vector<PointRow> points(kNoReturns, PointRow{0, 0, 0, 0});
  for (float y = -0.5F; y < 0.5F; y += 0.01F) {
    for (float z = -0.2F; z < 0.3F; z += 0.01F) {
      const float x = scan < 3 && MeetsTheCar(y, z) ? kCarX : kWallX;
      points.push_back({x, y * x, z * x, 0.5F});
    }
  }
  return points;
}

std::string Contents(const fs::path& path) {
  std::ostringstream contents;
  contents << std::ifstream(path, std::ios::binary).rdbuf();
  return contents.str();
}

class Clean : public ::testing::Test {
 protected:
  Clean() {
    std::string poses;
    for (int i = 0; i < kScans; ++i) {
      WriteBin(session() / "velodyne" / (std::to_string(i) + ".bin"), ScanNumber(i));
      poses += kIdentityRow;
    }
    WriteText(session() / "poses.txt", poses);
  }

  fs::path session() const { return directory_.path() / "session"; }
  fs::path Out(const std::string& name) const { return directory_.path() / name; }

  /// The labels of one scan, one a point of its file.
  static std::vector<uint32_t> Labels(const fs::path& out, int scan) {
    const std::string bytes = Contents(out / "labels" / (std::to_string(scan) + ".label"));
    std::vector<uint32_t> labels(bytes.size() / sizeof(uint32_t));
    std::copy(bytes.begin(), bytes.end(), reinterpret_cast<char*>(labels.data()));
    return labels;
  }

 private:
  TemporaryDirectory directory_;
};

TEST_F(Clean, LabelsEveryPointOfEveryFileAndKeepsTheOriginals) {
  const ProgramResult result = RunMapkeep({"clean", session(), Out("a"), "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  size_t kept = 0, car = 0, car_removed = 0, wall = 0, wall_removed = 0;
  for (int scan = 0; scan < kScans; ++scan) {
    const std::vector<PointRow> points = ScanNumber(scan);
    const std::vector<uint32_t> labels = Labels(Out("a"), scan);
    ASSERT_EQ(labels.size(), points.size());
    EXPECT_EQ(labels[0], 0U) << "a point at the sensor is neither kept nor removed";
    for (size_t i = kNoReturns; i < points.size(); ++i) {
      ASSERT_TRUE(labels[i] == 9 || labels[i] == 251) << labels[i];
      const bool removed = labels[i] == 251, on_car = points[i][0] == kCarX;
      (on_car ? car : wall) += 1;
      (on_car ? car_removed : wall_removed) += removed ? 1 : 0;
      kept += removed ? 0 : 1;
    }
  }
  EXPECT_GT(car, 0U);
  EXPECT_GE(car_removed, car * 9 / 10);
  EXPECT_LE(wall_removed, wall / 100);
  pcl::PointCloud<pcl::PointXYZI> cloud;
  ASSERT_EQ(pcl::io::loadPCDFile((Out("a") / "static.pcd").string(), cloud), 0);
  EXPECT_EQ(cloud.size(), kept);
  EXPECT_TRUE(std::all_of(cloud.begin(), cloud.end(), [](const auto& p) { return p.x == kWallX || p.x == kCarX; }));

  const auto report = nlohmann::json::parse(result.out);
  EXPECT_EQ(report, nlohmann::json::parse(Contents(Out("a") / "report.json")));
  EXPECT_EQ(report["scans"], kScans);
  EXPECT_EQ(report["no_returns"], kScans * kNoReturns);
  EXPECT_EQ(report["points"].get<size_t>() - report["points_removed"].get<size_t>(), kept);
  EXPECT_GT(report["ms_per_scan"].get<double>(), 0);
}

TEST_F(Clean, AblationScoresTheSessionWithEachRefinementAndWritesNothing) {
  for (int scan = 0; scan < kScans; ++scan) {
    std::string labels;
    for (const PointRow& point : ScanNumber(scan)) {
      const uint32_t label = point[0] == kCarX ? 5U << 16 | 251U : 9U;
      labels.append(reinterpret_cast<const char*>(&label), sizeof label);
    }
    WriteText(session() / "label" / (std::to_string(scan) + ".label"), labels);
  }
  const ProgramResult result = RunMapkeep({"clean", session(), "--ablation", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const auto rows = nlohmann::json::parse(result.out);
  ASSERT_GE(rows.size(), 5U);
  EXPECT_EQ(rows[0]["refinements"], "none");
  EXPECT_EQ(rows[3]["refinements"], "+ clusters");
  for (const auto& row : rows) {
    EXPECT_NEAR(row["AA"].get<double>(), std::sqrt(row["SA"].get<double>() * row["DA"].get<double>()), 1e-9);
    EXPECT_GT(row["ms_per_scan"].get<double>(), 0);
  }
  // The last row is `clean`.
  ASSERT_EQ(RunMapkeep({"clean", session(), Out("a")}).exit_code, 0);
  size_t car = 0, removed = 0;
  for (int scan = 0; scan < kScans; ++scan) {
    const std::vector<PointRow> points = ScanNumber(scan);
    const std::vector<uint32_t> labels = Labels(Out("a"), scan);
    for (size_t i = kNoReturns; i < points.size(); ++i) {
      if (points[i][0] != kCarX) continue;
      ++car;
      removed += labels[i] == 251 ? 1 : 0;
    }
  }
  EXPECT_DOUBLE_EQ(rows.back()["DA"].get<double>(), 100.0 * static_cast<double>(removed) / static_cast<double>(car));

  const ProgramResult table = RunMapkeep({"clean", session(), "--ablation"});
  EXPECT_THAT(table.out, ::testing::ContainsRegex("none +[0-9.]+ +[0-9.]+ +[0-9.]+ +[0-9.]+\n"));
}

TEST_F(Clean, AblationSaysWhatIsWrongWithTheTruth) {
  const ProgramResult without = RunMapkeep({"clean", session(), "--ablation"});
  EXPECT_EQ(without.exit_code, 2);
  EXPECT_THAT(without.error, ::testing::HasSubstr("label/"));
  for (int scan = 0; scan < kScans; ++scan) {
    WriteText(session() / "label" / (std::to_string(scan) + ".label"), "four");
  }
  const ProgramResult short_file = RunMapkeep({"clean", session(), "--ablation"});
  EXPECT_EQ(short_file.exit_code, 2);
  EXPECT_THAT(short_file.error, ::testing::HasSubstr(".label: 4 bytes for"));
  EXPECT_EQ(RunMapkeep({"clean", session(), Out("a"), "--ablation"}).exit_code, 2) << "nothing would be written there";
  EXPECT_EQ(RunMapkeep({"clean", session()}).exit_code, 2) << "nowhere to write to";
}

TEST_F(Clean, OneAndTwoThreadsWriteTheSameBytes) {
  ASSERT_EQ(RunMapkeep({"clean", session(), Out("one"), "--threads", "1"}).exit_code, 0);
  ASSERT_EQ(RunMapkeep({"clean", session(), Out("two"), "--threads", "2"}).exit_code, 0);
  EXPECT_TRUE(Contents(Out("one") / "static.pcd") == Contents(Out("two") / "static.pcd"));
  for (int scan = 0; scan < kScans; ++scan) EXPECT_EQ(Labels(Out("one"), scan), Labels(Out("two"), scan));
}

TEST_F(Clean, FarFromZeroTheSamePointsAreKeptToTheMillimetre) {
  const std::string row = "1 0 0 456789.5 0 1 0 5412345.25 0 0 1 100\n";
  std::string poses;
  for (int i = 0; i < kScans; ++i) poses += row;
  WriteText(session() / "poses.txt", poses);
  ASSERT_EQ(RunMapkeep({"clean", session(), Out("far")}).exit_code, 0);
  EXPECT_EQ(Labels(Out("far"), 0)[1], 9U);
  const std::string pcd = Contents(Out("far") / "static.pcd");
  EXPECT_NE(pcd.find("SIZE 8 8 8 4"), std::string::npos);
}

TEST_F(Clean, WhatCannotBeWrittenIsAFailure) {
  WriteText(Out("file"), "in the way");
  const ProgramResult result = RunMapkeep({"clean", session(), Out("file")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, ::testing::HasSubstr("cannot be made"));
}

}  // namespace
}  // namespace mapkeep
