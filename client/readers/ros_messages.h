#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "client/readers/message_cursor.h"
#include "core/geometry/pose.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// The kinds of messages that a session is made of.
enum class MessageKind : uint8_t { kPointCloud, kOdometry, kPose, kTransforms, kOther };

/// Of a type as ROS 1 or ROS 2 names it, such as sensor_msgs/msg/PointCloud2.
MessageKind KindOf(std::string_view type);

/// A sensor_msgs/PointCloud2 as points.
struct CloudMessage {
  double stamp = 0;  ///< seconds since 1970; 0: not set
  std::string frame;
  Scan scan;                   ///< every point, also those that are no return; intensities as they stand
  std::vector<float> offsets;  ///< seconds from the stamp to each point's time; empty: the cloud has no such field
};

/// A pose of `child` in `frame`: of nav_msgs/Odometry, geometry_msgs/PoseStamped or PoseWithCovarianceStamped (which
/// name no child), or one transform of a tf2_msgs/TFMessage.
struct PoseMessage {
  double stamp = 0;
  std::string frame, child;
  Pose pose = Pose::Identity();
};

// All give INVALID_ARGUMENT saying what is wrong with the message, without naming it.

/// The header alone: cheap.
absl::StatusOr<CloudMessage> ReadCloudHeader(MessageEncoding encoding, std::string_view message);

/// Fields x, y, z are needed. The time of a point is a field t, time, timestamp, time_stamp, offset_time or
/// point_time_offset: whole numbers are nanoseconds, float32 seconds, both from the stamp; float64 counts from 1970 or
/// from the stamp, in the unit that its size tells.
absl::StatusOr<CloudMessage> ReadCloud(MessageEncoding encoding, std::string_view message);

absl::StatusOr<std::vector<PoseMessage>> ReadPoses(MessageKind kind, MessageEncoding encoding,
                                                   std::string_view message);

}  // namespace mapkeep
