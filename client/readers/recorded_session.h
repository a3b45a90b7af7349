#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>

#include "client/readers/recording.h"
#include "client/readers/session_directory.h"

namespace mapkeep {

/// A session out of a recording: the clouds of one topic, each with the sensor's pose at its stamp.
///
/// Clouds: of the topic with the most PointCloud2 messages, or options.points_topic. A cloud without a stamp has the
/// time when it was recorded. Poses, from the first of these that there is, or from options.poses_topic:
/// 1. nav_msgs/Odometry, of the topic with the most messages;
/// 2. geometry_msgs/PoseStamped or PoseWithCovarianceStamped, likewise;
/// 3. tf, from options.fixed_frame (odom, else map, else the root) to the clouds' frame.
/// A pose topic's child frame need not be the clouds' own: static transforms lead from one to the other; without any,
/// options.poses_are_of_sensor has to say that the two are one. Poses between two messages are interpolated. Clouds
/// before the first and after the last pose are left out.
///
/// INVALID_ARGUMENT naming the file, topic and message: no such topic, a message that cannot be read, a gap of more
/// than a second in the poses, frames that nothing connects.
absl::StatusOr<SessionDirectory> SessionOf(std::shared_ptr<const Recording> recording,
                                           const std::filesystem::path& path, const SessionOptions& options);

absl::StatusOr<SessionDirectory> OpenRosBagSession(const std::filesystem::path& path, const SessionOptions& options);
absl::StatusOr<SessionDirectory> OpenMcapSession(const std::filesystem::path& path, const SessionOptions& options);

}  // namespace mapkeep
