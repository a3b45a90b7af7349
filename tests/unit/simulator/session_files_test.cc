#include "client/simulator/session_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "client/readers/session_directory.h"
#include "client/simulator/sessions_folder.h"
#include "client/simulator/street_session.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class SessionFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / (std::string("mapkeep_simulator_") + info->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path folder_;
};

SimulatedSession SmallSession(int index = 0) {
  static const Street* const street = new Street(*MakeStreet({.seed = 9, .change_rate = 0.5}));
  auto session =
      DriveThrough(*street, index, {.sensor = *SensorNamed("vlp16"), .scans = 4, .odometry = {.drift = 0.5}});
  EXPECT_TRUE(session.ok()) << session.status();
  return *std::move(session);
}

TEST_F(SessionFiles, AllLayoutsReadBackAsTheSameSession) {
  const SimulatedSession session = SmallSession();
  struct Case {
    const char* name;
    SessionLayout layout;
    PcdEncoding encoding;
    double tolerance;  // metres
  };
  const std::vector<Case> cases = {{"kitti", SessionLayout::kKitti, PcdEncoding::kBinary, 0},
                                   {"elite", SessionLayout::kElite, PcdEncoding::kBinary, 0},
                                   {"elite-ascii", SessionLayout::kElite, PcdEncoding::kAscii, 0},
                                   {"kth", SessionLayout::kKth, PcdEncoding::kBinary, 1e-3},
                                   {"kth-compressed", SessionLayout::kKth, PcdEncoding::kCompressed, 1e-3}};
  for (const Case& c : cases) {
    SCOPED_TRACE(c.name);
    const absl::Status written = WriteSession(session, folder_ / c.name, c.layout, c.encoding);
    ASSERT_TRUE(written.ok()) << written;
    const auto directory = OpenSessionDirectory(folder_ / c.name);
    ASSERT_TRUE(directory.ok()) << directory.status();
    EXPECT_EQ(directory->layout, c.layout);
    ASSERT_EQ(directory->poses.size(), session.odometry.size());
    ASSERT_EQ(directory->times.size(), session.times.size());
    for (size_t i = 0; i < session.scans.count; ++i) {
      EXPECT_TRUE(directory->poses[i].isApprox(session.odometry[i], c.tolerance > 0 ? 1e-5 : 1e-12));
      EXPECT_NEAR(directory->times[i], session.times[i], 1e-5);
      const auto read = ReadScan(*directory, i);
      ASSERT_TRUE(read.ok()) << read.status();
      const Scan truth = *session.scans.read(i);
      ASSERT_EQ(read->scan.points.size(), truth.points.size());
      EXPECT_EQ(read->scan.intensities, truth.intensities);
      for (size_t k = 0; k < truth.points.size(); ++k) {
        ASSERT_LE((read->scan.points[k] - truth.points[k]).norm(), c.tolerance) << "point " << k << " of scan " << i;
      }
    }
  }
}

TEST_F(SessionFiles, LabelsAreOneAPointMovingStaticOrUnsure) {
  const SimulatedSession session = SmallSession();
  ASSERT_TRUE(WriteSession(session, folder_ / "session-01", SessionLayout::kKitti).ok());
  for (size_t i = 0; i < session.scans.count; ++i) {
    std::ifstream file(folder_ / "session-01/label" / ("00000" + std::to_string(i) + ".label"), std::ios::binary);
    std::vector<uint32_t> labels(fs::file_size(folder_ / "session-01/label/000000.label"));
    file.read(reinterpret_cast<char*>(labels.data()), static_cast<std::streamsize>(4 * labels.size()));
    labels.resize(static_cast<size_t>(file.gcount()) / 4);
    EXPECT_EQ(labels, session.labelled(i)->labels);
    for (const uint32_t label : labels) {
      const uint32_t truth = ClassOfLabel(label);
      ASSERT_TRUE(truth == kMovingLabel || truth == kStaticLabel || truth == kUnsureLabel) << truth;
    }
  }
}

TEST_F(SessionFiles, WhatMatchesTheObjectsFileIsWhereItSays) {
  const SimulatedSession session = SmallSession(1);
  ASSERT_TRUE(WriteSession(session, folder_ / "session-02", SessionLayout::kKitti).ok());
  std::ifstream file(folder_ / "session-02/objects.json");
  const auto json = nlohmann::json::parse(file);
  std::map<uint32_t, nlohmann::json> objects;
  std::map<std::string, int> states;
  for (const auto& object : json.at("objects")) {
    objects[object.at("id")] = object;
    ++states[object.at("state")];
  }
  for (const char* state : {"standing", "parked", "arrived", "moved", "left", "moving"})
    EXPECT_GT(states[state], 0) << state;

  const auto box_distance = [](const nlohmann::json& object, const Eigen::Vector3d& point) {
    const auto vector = [&](const char* key) {
      const auto values = object.at(key).get<std::vector<double>>();
      return Eigen::Vector3d(values[0], values[1], values[2]);
    };
    const auto q = object.at("orientation").get<std::vector<double>>();
    const Eigen::Vector3d local = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).inverse() * (point - vector("centre"));
    return (local.cwiseAbs() - vector("size") / 2).cwiseMax(0).norm();
  };
  size_t on_parked = 0;
  const auto labelled = session.labelled(0);
  for (size_t i = 0; i < labelled->labels.size(); ++i) {
    const Eigen::Vector3d point = session.truth[0] * labelled->scan.points[i].cast<double>();
    const nlohmann::json& object = objects.at(ObjectOfLabel(labelled->labels[i]));
    EXPECT_EQ(object.at("state") == "moving", ClassOfLabel(labelled->labels[i]) != kStaticLabel);
    EXPECT_NE(object.at("state"), "left");
    if (object.at("state") != "parked" && object.at("state") != "arrived" && object.at("state") != "moved") continue;
    EXPECT_LT(box_distance(object, point), 1.4) << "a mixed pixel is at most half a gap off";
    on_parked += box_distance(object, point) < 0.1 ? 1 : 0;
  }
  EXPECT_GT(on_parked, 200U);
}

TEST_F(SessionFiles, TheKthTruthCloudHoldsEveryPointThatIsSure) {
  const SimulatedSession session = SmallSession();
  ASSERT_TRUE(WriteSession(session, folder_ / "kth", SessionLayout::kKth, PcdEncoding::kAscii).ok());
  size_t points = 0;
  for (size_t i = 0; i < session.scans.count; ++i) {
    const auto labelled = session.labelled(i);
    for (const uint32_t label : labelled->labels) points += ClassOfLabel(label) == kUnsureLabel ? 0 : 1;
  }
  std::ifstream file(folder_ / "kth/gt_cloud.pcd", std::ios::binary);
  std::string line;
  size_t announced = 0;
  while (std::getline(file, line) && line.rfind("DATA", 0) != 0) {
    if (line.rfind("POINTS ", 0) == 0) announced = std::stoul(line.substr(7));
  }
  EXPECT_EQ(line, "DATA binary");
  EXPECT_EQ(announced, points);
}

TEST_F(SessionFiles, AnInterruptedRunLeavesNothingThatLooksWhole) {
  const auto stop_half_way = [](double fraction) { return fraction < 0.5; };
  const absl::Status status =
      WriteSession(SmallSession(), folder_ / "session-01", SessionLayout::kKitti, PcdEncoding::kBinary, stop_half_way);
  EXPECT_EQ(status.code(), absl::StatusCode::kCancelled);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(SessionFiles, AnExistingDirectoryStaysAsItIs) {
  fs::create_directories(folder_ / "session-01");
  const absl::Status status = WriteSession(SmallSession(), folder_ / "session-01", SessionLayout::kKitti);
  EXPECT_EQ(status.code(), absl::StatusCode::kAlreadyExists);
  EXPECT_THAT(std::string(status.message()), HasSubstr("session-01"));
  EXPECT_TRUE(fs::is_empty(folder_ / "session-01"));
}

TEST_F(SessionFiles, AFolderOfSessionsIsReplacedOnlyWhenAskedAndNothingElseIsEverRemoved) {
  const fs::path out = folder_ / "out";
  ASSERT_TRUE(PrepareSessionsFolder(out, false).ok());
  ASSERT_TRUE(PrepareSessionsFolder(out, false).ok()) << "an empty folder is no obstacle";
  fs::create_directories(out / SessionFolderName(0) / "velodyne");
  fs::create_directories(out / ".session-02.partial");
  EXPECT_THAT(std::string(PrepareSessionsFolder(out, false).message()), HasSubstr("not empty"));
  EXPECT_TRUE(fs::exists(out / "session-01/velodyne"));
  EXPECT_TRUE(PrepareSessionsFolder(out, true).ok());
  EXPECT_TRUE(fs::is_empty(out));

  std::ofstream(out / "thesis.txt") << "years of work";
  fs::create_directories(out / "session-01");
  EXPECT_THAT(std::string(PrepareSessionsFolder(out, true).message()), HasSubstr("holds"));
  EXPECT_TRUE(fs::exists(out / "thesis.txt"));
}

}  // namespace
}  // namespace mapkeep
