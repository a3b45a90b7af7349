#include "client/readers/ros_messages.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "client/readers/session_directory.h"

namespace mapkeep {
namespace {

enum FieldType : uint8_t { kInt8 = 1, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };
constexpr std::array<size_t, 9> kFieldSizes = {0, 1, 1, 2, 2, 4, 4, 4, 8};
constexpr uint32_t kMostFields = 1000;
constexpr uint32_t kMostTransforms = 10'000;

struct Header {
  double stamp = 0;
  std::string frame;
};

Header TakeHeader(MessageCursor& cursor) {
  if (!cursor.is_cdr()) cursor.Take<uint32_t>();  // seq
  const double seconds =
      cursor.is_cdr() ? static_cast<double>(cursor.Take<int32_t>()) : static_cast<double>(cursor.Take<uint32_t>());
  const auto nanoseconds = cursor.Take<uint32_t>();
  Header header{seconds + 1e-9 * nanoseconds, {}};
  header.frame = cursor.TakeString();
  // tf's first version began names with a slash.
  if (header.frame.starts_with('/')) header.frame.erase(0, 1);
  return header;
}

std::string TakeFrame(MessageCursor& cursor) {
  std::string frame = cursor.TakeString();
  if (frame.starts_with('/')) frame.erase(0, 1);
  return frame;
}

absl::StatusOr<Pose> TakePose(MessageCursor& cursor) {
  std::array<double, 7> v{};
  for (double& number : v) number = cursor.Take<double>();
  if (!cursor.ok()) return absl::InvalidArgumentError("it ends early, or is not encoded as its topic says");
  const Eigen::Quaterniond rotation(v[6], v[3], v[4], v[5]);
  const double norm = rotation.norm();
  constexpr double kNotUnit = 0.01;
  if (!std::ranges::all_of(v, [](double number) { return std::isfinite(number); })) {
    return absl::InvalidArgumentError("its pose is not finite");
  }
  if (std::abs(norm - 1) > kNotUnit) {
    return absl::InvalidArgumentError(
        absl::StrFormat("its orientation is no rotation: a quaternion of length %g", norm));
  }
  Pose pose = Pose::Identity();
  pose.linear() = rotation.normalized().toRotationMatrix();
  pose.translation() = Eigen::Vector3d(v[0], v[1], v[2]);
  return pose;
}

struct Field {
  uint32_t offset = 0;
  uint8_t type = 0;  ///< 0: there is none
};

double NumberAt(const char* point, const Field& field, bool swap) {
  char bytes[8];
  const size_t size = kFieldSizes[field.type];
  std::memcpy(bytes, point + field.offset, size);
  if (swap) std::reverse(bytes, bytes + size);
  const auto as = [&bytes](auto number) {
    std::memcpy(&number, bytes, sizeof(number));
    return static_cast<double>(number);
  };
  switch (field.type) {
    case kInt8:
      return as(int8_t{});
    case kUint8:
      return as(uint8_t{});
    case kInt16:
      return as(int16_t{});
    case kUint16:
      return as(uint16_t{});
    case kInt32:
      return as(int32_t{});
    case kUint32:
      return as(uint32_t{});
    case kFloat32:
      return as(float{});
    default:
      return as(double{});
  }
}

/// What turns a float64 time into seconds: clocks count from 1970 in seconds, micro- or nanoseconds.
double UnitOf(double time) {
  const double size = std::abs(time);
  if (size > 1e17) return 1e-9;
  if (size > 1e14) return 1e-6;
  return 1;
}

float OffsetOf(double value, uint8_t type, double stamp) {
  if (type == kFloat32) return static_cast<float>(value);
  if (type != kFloat64) return static_cast<float>(1e-9 * value);
  const double seconds = value * UnitOf(value);
  return static_cast<float>(CountsFrom1970(seconds) ? seconds - stamp : seconds);
}

struct Layout {
  Field x, y, z, intensity, time;
};

/// The fields of the cloud; those that we do not know are passed over.
absl::StatusOr<Layout> TakeFields(MessageCursor& cursor) {
  Layout layout;
  const auto count = cursor.Take<uint32_t>();
  if (count > kMostFields) return absl::InvalidArgumentError("it has an absurd number of fields");
  for (uint32_t i = 0; i < count; ++i) {
    const std::string name = cursor.TakeString();
    Field field{cursor.Take<uint32_t>(), cursor.Take<uint8_t>()};
    cursor.Take<uint32_t>();  // how many; ours are single
    if (!cursor.ok()) return absl::InvalidArgumentError("its fields end early");
    if (field.type < kInt8 || field.type > kFloat64) {
      return absl::InvalidArgumentError(absl::StrFormat("field '%s' has the unknown type %d", name, field.type));
    }
    const auto is_any = [&name](std::initializer_list<std::string_view> names) {
      return std::ranges::find(names, std::string_view(name)) != names.end();
    };
    if (name == "x") layout.x = field;
    if (name == "y") layout.y = field;
    if (name == "z") layout.z = field;
    if (name == "intensity") layout.intensity = field;
    if (layout.intensity.type == 0 && is_any({"reflectivity", "i"})) layout.intensity = field;
    if (is_any({"t", "time", "timestamp", "time_stamp", "offset_time", "point_time_offset"})) layout.time = field;
  }
  for (const auto& [field, name] : {std::pair(&layout.x, 'x'), std::pair(&layout.y, 'y'), std::pair(&layout.z, 'z')}) {
    if (field->type != kFloat32 && field->type != kFloat64) {
      return absl::InvalidArgumentError(absl::StrFormat("it has no field '%c' of floating point", name));
    }
  }
  return layout;
}

}  // namespace

MessageKind KindOf(std::string_view type) {
  const std::string name = absl::StrReplaceAll(std::string(type), {{"/msg/", "/"}});
  if (name == "sensor_msgs/PointCloud2") return MessageKind::kPointCloud;
  if (name == "nav_msgs/Odometry") return MessageKind::kOdometry;
  if (name == "geometry_msgs/PoseStamped" || name == "geometry_msgs/PoseWithCovarianceStamped")
    return MessageKind::kPose;
  if (name == "tf2_msgs/TFMessage" || name == "tf/tfMessage") return MessageKind::kTransforms;
  return MessageKind::kOther;
}

absl::StatusOr<CloudMessage> ReadCloudHeader(MessageEncoding encoding, std::string_view message) {
  MessageCursor cursor(encoding, message);
  Header header = TakeHeader(cursor);
  if (!cursor.ok()) return absl::InvalidArgumentError("it ends early, or is not encoded as its topic says");
  return CloudMessage{.stamp = header.stamp, .frame = std::move(header.frame), .scan = {}, .offsets = {}};
}

absl::StatusOr<CloudMessage> ReadCloud(MessageEncoding encoding, std::string_view message) {
  MessageCursor cursor(encoding, message);
  Header header = TakeHeader(cursor);
  const uint64_t height = cursor.Take<uint32_t>(), width = cursor.Take<uint32_t>();
  const absl::StatusOr<Layout> layout = TakeFields(cursor);
  if (!layout.ok()) return layout.status();
  const bool big_endian = cursor.Take<uint8_t>() != 0;
  const uint64_t point_step = cursor.Take<uint32_t>(), row_step = cursor.Take<uint32_t>();
  const std::string_view data = cursor.TakeBytes(cursor.Take<uint32_t>());
  if (!cursor.ok()) return absl::InvalidArgumentError("it ends early, or is not encoded as its topic says");
  if (height * width > kMostPoints) {
    return absl::InvalidArgumentError(
        absl::StrFormat("it holds %d points, more than the %d of a scan", height * width, kMostPoints));
  }
  if (height > 0 && width > 0 &&
      (row_step < width * point_step || data.size() < (height - 1) * row_step + width * point_step)) {
    return absl::InvalidArgumentError("its data are shorter than its points");
  }
  for (const Field& field : {layout->x, layout->y, layout->z, layout->intensity, layout->time}) {
    if (field.type != 0 && field.offset + kFieldSizes[field.type] > point_step) {
      return absl::InvalidArgumentError("a field lies beyond the end of a point");
    }
  }
  CloudMessage cloud{.stamp = header.stamp, .frame = std::move(header.frame), .scan = {}, .offsets = {}};
  cloud.scan.points.reserve(height * width);
  for (uint64_t row = 0; row < height; ++row) {
    for (uint64_t column = 0; column < width; ++column) {
      const char* point = data.data() + row * row_step + column * point_step;
      const auto number = [&](const Field& field) { return NumberAt(point, field, big_endian); };
      cloud.scan.points.emplace_back(static_cast<float>(number(layout->x)), static_cast<float>(number(layout->y)),
                                     static_cast<float>(number(layout->z)));
      if (layout->intensity.type != 0) cloud.scan.intensities.push_back(static_cast<float>(number(layout->intensity)));
      if (layout->time.type != 0) {
        cloud.offsets.push_back(OffsetOf(number(layout->time), layout->time.type, header.stamp));
      }
    }
  }
  return cloud;
}

absl::StatusOr<std::vector<PoseMessage>> ReadPoses(MessageKind kind, MessageEncoding encoding,
                                                   std::string_view message) {
  MessageCursor cursor(encoding, message);
  std::vector<PoseMessage> poses;
  const uint32_t count = kind == MessageKind::kTransforms ? cursor.Take<uint32_t>() : 1;
  if (count > kMostTransforms) return absl::InvalidArgumentError("it has an absurd number of transforms");
  for (uint32_t i = 0; i < count; ++i) {
    Header header = TakeHeader(cursor);
    PoseMessage pose{.stamp = header.stamp, .frame = std::move(header.frame), .child = {}};
    if (kind != MessageKind::kPose) pose.child = TakeFrame(cursor);
    const absl::StatusOr<Pose> read = TakePose(cursor);
    if (!read.ok()) return read.status();
    pose.pose = *read;
    poses.push_back(std::move(pose));
  }
  if (!cursor.ok()) return absl::InvalidArgumentError("it ends early, or is not encoded as its topic says");
  return poses;
}

}  // namespace mapkeep
