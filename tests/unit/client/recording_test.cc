#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <numbers>

#include "client/readers/deskew.h"
#include "client/readers/recorded_session.h"
#include "client/readers/transform_tree.h"
#include "tests/unit/client/session_files.h"

namespace mapkeep {
namespace {

using testing::HasSubstr;

constexpr double kStart = 1.7e9;

/// Messages as ROS 1 packs them.
class Packer {
 public:
  template <typename Number>
  Packer& Put(Number number) {
    bytes_.append(reinterpret_cast<const char*>(&number), sizeof(number));
    return *this;
  }
  Packer& Text(const std::string& text) {
    Put(static_cast<uint32_t>(text.size()));
    bytes_ += text;
    return *this;
  }
  Packer& Header(double stamp, const std::string& frame) {
    const auto seconds = static_cast<uint32_t>(stamp);
    return Put(uint32_t{0}).Put(seconds).Put(static_cast<uint32_t>(1e9 * (stamp - seconds))).Text(frame);
  }
  Packer& At(const Pose& pose) {
    const Eigen::Quaterniond q(pose.linear());
    for (const double v :
         {pose.translation().x(), pose.translation().y(), pose.translation().z(), q.x(), q.y(), q.z(), q.w()}) {
      Put(v);
    }
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// Fields x, y, z, intensity and a time in nanoseconds, then a gap.
std::string Cloud(double stamp, const std::string& frame, const std::vector<std::array<float, 4>>& points,
                  const std::vector<uint32_t>& times = {}) {
  Packer cloud;
  cloud.Header(stamp, frame).Put(uint32_t{1}).Put(static_cast<uint32_t>(points.size()));
  cloud.Put(static_cast<uint32_t>(times.empty() ? 4 : 5));
  uint32_t offset = 0;
  for (const char* name : {"x", "y", "z", "intensity"}) {
    cloud.Text(name).Put(offset).Put(uint8_t{7}).Put(uint32_t{1});
    offset += 4;
  }
  if (!times.empty()) cloud.Text("t").Put(offset).Put(uint8_t{6}).Put(uint32_t{1});
  constexpr uint32_t kStep = 24;
  cloud.Put(uint8_t{0}).Put(kStep).Put(static_cast<uint32_t>(kStep * points.size()));
  cloud.Put(static_cast<uint32_t>(kStep * points.size()));
  for (size_t i = 0; i < points.size(); ++i) {
    for (const float v : points[i]) cloud.Put(v);
    cloud.Put(times.empty() ? uint32_t{0} : times[i]).Put(uint32_t{0});
  }
  cloud.Put(uint8_t{1});
  return cloud.bytes();
}

std::string Odometry(double stamp, const std::string& child, const Pose& pose) {
  Packer message;
  message.Header(stamp, "odom").Text(child).At(pose);
  for (int i = 0; i < 36 + 6 + 36; ++i) message.Put(0.0);
  return message.bytes();
}

std::string Transform(double stamp, const std::string& parent, const std::string& child, const Pose& pose) {
  return Packer().Put(uint32_t{1}).Header(stamp, parent).Text(child).At(pose).bytes();
}

Pose Moved(double x, double y = 0, double z = 0) { return Pose(Eigen::Translation3d(x, y, z)); }

/// A recording in memory.
class FakeRecording final : public Recording {
 public:
  void Add(const std::string& topic, const std::string& type, const std::string& message) {
    size_t at = 0;
    while (at < topics_.size() && topics_[at].name != topic) ++at;
    if (at == topics_.size()) {
      topics_.push_back({topic, type, KindOf(type), MessageEncoding::kRos1});
      messages_.emplace_back();
    }
    ++topics_[at].messages;
    messages_[at].push_back(message);
  }
  const std::vector<RecordedTopic>& topics() const override { return topics_; }
  absl::StatusOr<std::string> Read(size_t topic, uint64_t index) const override { return messages_[topic][index]; }
  double TimeOf(size_t, uint64_t index) const override { return kStart + 0.1 * static_cast<double>(index); }

 private:
  std::vector<RecordedTopic> topics_;
  std::vector<std::vector<std::string>> messages_;
};

class RecordedSession : public testing::Test {
 protected:
  void AddClouds(int count, const std::string& topic = "/points", const std::string& frame = "lidar") {
    for (int i = 0; i < count; ++i) {
      recording_->Add(topic, "sensor_msgs/PointCloud2",
                      Cloud(kStart + 0.1 * i, frame, {{1, 2, 3, 50}, {4, 5, 6, 200}}, {0, 50'000'000}));
    }
  }
  /// At 1 m/s along x, twice as often as clouds and between them.
  void AddOdometry(int count, const std::string& child = "lidar", double start = kStart - 0.025) {
    for (int i = 0; i < count; ++i) {
      recording_->Add("/odom", "nav_msgs/Odometry",
                      Odometry(start + 0.05 * i, child, Moved(start + 0.05 * i - kStart)));
    }
  }
  absl::StatusOr<SessionDirectory> Open(const SessionOptions& options = {}) {
    return SessionOf(recording_, "drive.bag", options);
  }
  std::string Error(const SessionOptions& options = {}) { return std::string(Open(options).status().message()); }

  std::shared_ptr<FakeRecording> recording_ = std::make_shared<FakeRecording>();
};

TEST_F(RecordedSession, PosesAreInterpolatedAtTheCloudsStamps) {
  AddClouds(5);
  AddOdometry(12);
  const auto session = Open();
  ASSERT_TRUE(session.ok()) << session.status();
  ASSERT_EQ(session->files.size(), 5U);
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(session->poses[i].translation().x(), 0.1 * i, 1e-6);
    EXPECT_NEAR(session->times[i], kStart + 0.1 * i, 1e-6);
  }
  const auto scan = session->read_file(session->files[3]);
  ASSERT_TRUE(scan.ok()) << scan.status();
  EXPECT_EQ(scan->points[1], Eigen::Vector3f(4, 5, 6));
  EXPECT_EQ(scan->intensities, (std::vector<float>{50, 200}));
}

TEST_F(RecordedSession, TheTopicWithTheMostCloudsIsTakenUnlessOneIsNamed) {
  AddClouds(2, "/few");
  AddClouds(4, "/many");
  AddOdometry(12);
  EXPECT_EQ(Open()->files.size(), 4U);
  EXPECT_EQ(Open({.points_topic = "/few"})->files.size(), 2U);
  EXPECT_THAT(Error({.points_topic = "/none"}),
              HasSubstr("drive.bag: --points-topic /none: no topic of that name and a type that fits: it holds /few "
                        "(sensor_msgs/PointCloud2, 2)"));
}

TEST_F(RecordedSession, CloudsOutsideThePosesAreLeftOutAndAGapIsAnError) {
  AddClouds(10);
  AddOdometry(5, "lidar", kStart + 0.15);  // to 0.35 s
  const auto session = Open();
  ASSERT_TRUE(session.ok()) << session.status();
  EXPECT_EQ(session->files.size(), 2U);
  EXPECT_EQ(session->files[0].filename(), "000002");
  AddOdometry(1, "lidar", kStart + 2);
  EXPECT_THAT(Error(), HasSubstr("drive.bag: topic /points, message 4: there is no pose within a second"));
}

TEST_F(RecordedSession, StaticTransformsLeadFromTheVehicleToTheSensor) {
  AddClouds(3);
  AddOdometry(12, "base");
  EXPECT_THAT(Error(), HasSubstr("its poses are of 'base' and the clouds' frame is 'lidar'"));
  EXPECT_NEAR(Open({.poses_are_of_sensor = true})->poses[0].translation().z(), 0, 1e-9);
  recording_->Add("/tf_static", "tf2_msgs/TFMessage", Transform(0, "base", "mast", Moved(0.5, 0, 1)));
  recording_->Add("/tf_static", "tf2_msgs/TFMessage", Transform(0, "mast", "lidar", Moved(0, 0, 0.7)));
  const auto session = Open();
  ASSERT_TRUE(session.ok()) << session.status();
  EXPECT_TRUE(session->poses[1].translation().isApprox(Eigen::Vector3d(0.6, 0, 1.7), 1e-6));
}

TEST_F(RecordedSession, WithoutOdometryTfSaysWhereTheSensorWas) {
  AddClouds(3);
  EXPECT_THAT(Error(), HasSubstr("nothing says where the sensor was"));
  for (int i = 0; i < 12; ++i) {
    recording_->Add("/tf", "tf2_msgs/TFMessage",
                    Transform(kStart - 0.01 + 0.05 * i, "odom", "base", Moved(0.05 * i - 0.01)));
    recording_->Add("/tf", "tf2_msgs/TFMessage", Transform(kStart - 0.01 + 0.05 * i, "map", "odom", Moved(100)));
  }
  recording_->Add("/tf_static", "tf2_msgs/TFMessage", Transform(0, "base", "lidar", Moved(0, 0, 2)));
  const auto in_odom = Open();
  ASSERT_TRUE(in_odom.ok()) << in_odom.status();
  EXPECT_TRUE(in_odom->poses[2].translation().isApprox(Eigen::Vector3d(0.2, 0, 2), 1e-6));
  const auto in_map = Open({.fixed_frame = "map"});
  ASSERT_TRUE(in_map.ok()) << in_map.status();
  EXPECT_TRUE(in_map->poses[2].translation().isApprox(Eigen::Vector3d(100.2, 0, 2), 1e-6));
  EXPECT_THAT(Error({.fixed_frame = "moon"}), HasSubstr("only to lidar, base, odom, map"));
}

TEST_F(RecordedSession, ABadMessageIsNamed) {
  AddClouds(2);
  recording_->Add("/points", "sensor_msgs/PointCloud2", Cloud(kStart + 0.2, "lidar", {{1, 2, 3, 4}}).substr(0, 90));
  AddOdometry(12);
  const auto session = Open();
  ASSERT_TRUE(session.ok()) << session.status();
  EXPECT_THAT(std::string(session->read_file(session->files[2]).status().message()),
              HasSubstr("drive.bag: topic /points, message 2: its fields end early"));
  Pose bent = Moved(0);
  recording_->Add("/odom", "nav_msgs/Odometry", Odometry(kStart, "lidar", bent).substr(0, 60));
  EXPECT_THAT(Error(), HasSubstr("drive.bag: topic /odom, message 12: it ends early"));
}

TEST_F(RecordedSession, DeskewMovesPointsByTheMotionSinceTheirScansTime) {
  AddClouds(3);
  AddOdometry(12);
  const auto session = Open({.deskew = true});
  ASSERT_TRUE(session.ok()) << session.status();
  const auto scan = session->read_file(session->files[1]);
  ASSERT_TRUE(scan.ok()) << scan.status();
  EXPECT_TRUE(scan->points[0].isApprox(Eigen::Vector3f(1, 2, 3)));
  EXPECT_TRUE(scan->points[1].isApprox(Eigen::Vector3f(4.05F, 5, 6), 1e-4F)) << "1 m/s for 50 ms";
}

TEST(Deskew, ATurningSensorIsFollowedOnItsArcAndNoReturnsStay) {
  PoseTrack track;
  for (int i = 0; i <= 10; ++i) {
    track.Add(0.1 * i, Pose(Eigen::AngleAxisd(0.3 * i, Eigen::Vector3d::UnitZ())));
  }
  track.Sort();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Scan scan{.points = {{1, 0, 0}, {0, 0, 0}, {nan, nan, nan}}, .intensities = {}, .time = 0.2};
  ASSERT_TRUE(Deskew(track, 0.2, {0.05F, 0.05F, nan}, &scan).ok());
  EXPECT_TRUE(scan.points[0].isApprox(Eigen::Vector3f(std::cos(0.15F), std::sin(0.15F), 0), 1e-4F));
  EXPECT_EQ(scan.points[1], Eigen::Vector3f::Zero());
  Scan late{.points = {{1, 0, 0}}, .intensities = {}, .time = 0.9};
  EXPECT_FALSE(Deskew(track, 0.9, {0.9F}, &late).ok());
}

TEST(TransformTree, CirclesEnd) {
  TransformTree tree;
  tree.Add({.frame = "a", .child = "b"}, true);
  tree.Add({.frame = "b", .child = "a"}, true);
  EXPECT_EQ(tree.ChainOf("a").size(), 2U);
  EXPECT_FALSE(tree.At("c", "a", 0).has_value());
}

TEST(Mulran, ScansLieBetweenTimedPosesAndHelipresPointsHaveTimes) {
  const TemporaryDirectory directory;
  std::filesystem::create_directories(directory.path() / "LiDAR" / "Ouster");
  std::string poses;
  for (int i = 0; i < 4; ++i) {
    poses += std::to_string(1'700'000'000'000'000'000 + i * 100'000'000LL) + ",1,0,0," + std::to_string(0.1 * i) +
             ",0,1,0,0,0,0,1,0\n";
  }
  WriteText(directory.path() / "global_pose.csv", poses);
  for (int i = 0; i < 3; ++i) {
    Packer points;
    for (uint32_t k = 0; k < 8; ++k) {  // 208 bytes are also 13 points of 16
      points.Put(4.F)
          .Put(5.F)
          .Put(6.F)
          .Put(100.F)
          .Put(k * 10'000'000)
          .Put(uint16_t{1})
          .Put(uint16_t{2})
          .Put(uint16_t{3});
    }
    WriteText(directory.path() / "LiDAR" / "Ouster" /
                  (std::to_string(1'700'000'000'050'000'000 + i * 100'000'000LL) + ".bin"),
              points.bytes());
  }
  const auto session = OpenSessionDirectory(directory.path(), {.deskew = true});
  ASSERT_TRUE(session.ok()) << session.status();
  EXPECT_EQ(session->layout, SessionLayout::kMulran);
  ASSERT_EQ(session->files.size(), 3U);
  EXPECT_NEAR(session->poses[1].translation().x(), 0.15, 1e-6);
  const auto scan = session->read_file(session->files[0]);
  ASSERT_TRUE(scan.ok()) << scan.status();
  ASSERT_EQ(scan->points.size(), 8U);
  EXPECT_TRUE(scan->points[0].isApprox(Eigen::Vector3f(4, 5, 6)));
  EXPECT_TRUE(scan->points[7].isApprox(Eigen::Vector3f(4.07F, 5, 6), 1e-4F));
  EXPECT_EQ(scan->intensities[0], 100);
  // The vehicle's poses, once the file says where the LiDAR is on it.
  WriteText(directory.path() / "calib.txt", "Tr: 1 0 0 0 0 1 0 0 0 0 1 1.8\n");
  EXPECT_NEAR(OpenSessionDirectory(directory.path())->poses[1].translation().z(), 1.8, 1e-9);
}

}  // namespace
}  // namespace mapkeep
