#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>

#include <fstream>

#include "client/readers/session_directory.h"
#include "tests/unit/client/session_files.h"

/// A message by its bytes, for librosbag to write.
struct PackedMessage {
  std::string type, bytes;
};

namespace ros {
namespace message_traits {
template <>
struct MD5Sum<PackedMessage> {
  static const char* value() { return "*"; }
  static const char* value(const PackedMessage&) { return "1158d486dd51d683ce2f1be655c3c181"; }
};
template <>
struct DataType<PackedMessage> {
  static const char* value() { return "*"; }
  static const char* value(const PackedMessage& message) { return message.type.c_str(); }
};
template <>
struct Definition<PackedMessage> {
  static const char* value() { return ""; }
  static const char* value(const PackedMessage&) { return ""; }
};
}  // namespace message_traits
namespace serialization {
template <>
struct Serializer<PackedMessage> {
  template <typename Stream>
  static void write(Stream& stream, const PackedMessage& message) {
    std::memcpy(stream.advance(static_cast<uint32_t>(message.bytes.size())), message.bytes.data(),
                message.bytes.size());
  }
  static uint32_t serializedLength(const PackedMessage& message) { return static_cast<uint32_t>(message.bytes.size()); }
};
}  // namespace serialization
}  // namespace ros

namespace mapkeep {
namespace {

using testing::HasSubstr;

constexpr uint32_t kStart = 1'700'000'000;

template <typename... Numbers>
std::string Pack(Numbers... numbers) {
  std::string bytes;
  (bytes.append(reinterpret_cast<const char*>(&numbers), sizeof(numbers)), ...);
  return bytes;
}
std::string Text(const std::string& text) { return Pack(static_cast<uint32_t>(text.size())) + text; }

/// Clouds at 10 Hz, odometry at 20 Hz and 1 m/s, and something else.
void WriteBag(const std::filesystem::path& path, rosbag::CompressionType compression) {
  rosbag::Bag bag(path.string(), rosbag::bagmode::Write);
  bag.setCompression(compression);
  for (uint32_t i = 0; i < 11; ++i) {
    const uint32_t nanoseconds = i * 50'000'000;
    const ros::Time time(kStart, nanoseconds);
    std::string odometry = Pack(i, kStart, nanoseconds) + Text("odom") + Text("lidar") +
                           Pack(0.05 * i, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0) + std::string(78 * 8, '\0');
    bag.write("/odom", time, PackedMessage{"nav_msgs/Odometry", odometry});
    bag.write("/chatter", time, PackedMessage{"std_msgs/String", Text("hello")});
    if (i % 2 == 1) continue;
    std::string cloud = Pack(i, kStart, nanoseconds) + Text("lidar") + Pack(uint32_t{1}, uint32_t{2}, uint32_t{3});
    for (uint32_t axis = 0; axis < 3; ++axis) {
      cloud += Text(std::string(1, "xyz"[axis])) + Pack(4 * axis, uint8_t{7}, uint32_t{1});
    }
    cloud += Pack(uint8_t{0}, uint32_t{12}, uint32_t{24}, uint32_t{24}, 1.F, 2.F, 3.F, 4.F, 5.F, 6.F + i, uint8_t{1});
    bag.write("/points", time, PackedMessage{"sensor_msgs/PointCloud2", cloud});
  }
  bag.close();
}

TEST(RosBag, WhatLibrosbagWroteIsReadInEveryCompression) {
  const TemporaryDirectory directory;
  for (const auto compression :
       {rosbag::compression::Uncompressed, rosbag::compression::BZ2, rosbag::compression::LZ4}) {
    const auto path = directory.path() / ("drive-" + std::to_string(compression) + ".bag");
    WriteBag(path, compression);
    const auto session = OpenSessionDirectory(path);
    ASSERT_TRUE(session.ok()) << session.status();
    EXPECT_EQ(session->layout, SessionLayout::kRosBag);
    ASSERT_EQ(session->files.size(), 6U);
    EXPECT_EQ(session->files[2], path / "points" / "000002");
    EXPECT_NEAR(session->poses[2].translation().x(), 0.2, 1e-9);
    const auto scan = ReadScan(*session, 2);
    ASSERT_TRUE(scan.ok()) << scan.status();
    ASSERT_EQ(scan->scan.points.size(), 2U);
    EXPECT_EQ(scan->scan.points[1], Eigen::Vector3f(4, 5, 10));
    EXPECT_NEAR(scan->scan.time, kStart + 0.2, 1e-6);
  }
}

TEST(RosBag, WhatWasBrokenOffOrIsNoneSaysSo) {
  const TemporaryDirectory directory;
  const auto path = directory.path() / "drive.bag";
  WriteBag(path, rosbag::compression::Uncompressed);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  const std::string broken(OpenSessionDirectory(path).status().message());
  EXPECT_THAT(broken, HasSubstr(path.string() + ": "));
  WriteText(path, "#ROSBAG V2.0\nnonsense");
  EXPECT_FALSE(OpenSessionDirectory(path).ok());
  WriteText(path, "no bag at all");
  EXPECT_THAT(std::string(OpenSessionDirectory(path).status().message()),
              HasSubstr("drive.bag: neither a ROS 1 bag nor an MCAP file"));
}

}  // namespace
}  // namespace mapkeep
