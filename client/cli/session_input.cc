#include "client/cli/session_input.h"

#include <optional>

#include "client/readers/frames.h"

namespace mapkeep {

void AddSessionInput(CLI::App& command, SessionInput& input) {
  command.add_option("DIR", input.directory, "Session directory, ROS 1 bag or MCAP file")->required();
  command
      .add_option("--format", input.format,
                  "Layout of DIR: kitti, elite, kth, mulran, rosbag or mcap; by default told by what is there")
      ->type_name("LAYOUT");
  command.add_option("--frames", input.frames, "Only these scans, both ends included, counted from 0")
      ->type_name("FIRST:LAST[:STEP]");
  command.add_flag("--deskew", input.options.deskew,
                   "Move the points to their scan's time, by the poses and the points' own times");
  command
      .add_option("--points-topic", input.options.points_topic,
                  "Of a recording: where the clouds are; by default the topic with the most")
      ->type_name("TOPIC");
  command
      .add_option("--poses-topic", input.options.poses_topic,
                  "Of a recording: Odometry or PoseStamped; by default the one with the most messages, else tf")
      ->type_name("TOPIC");
  command
      .add_option("--fixed-frame", input.options.fixed_frame,
                  "Of a recording: take the poses from tf, in this frame; by default odom, map or the root")
      ->type_name("FRAME");
  command.add_flag("--poses-are-of-sensor", input.options.poses_are_of_sensor,
                   "Of a recording: the poses are the sensor's own, whatever their frame is called");
}

absl::StatusOr<SessionDirectory> OpenSessionInput(const SessionInput& input) {
  std::optional<FrameRange> frames;
  if (!input.frames.empty()) {
    absl::StatusOr<FrameRange> parsed = ParseFrames(input.frames);
    if (!parsed.ok()) return parsed.status();
    frames = *parsed;
  }
  SessionOptions options = input.options;
  if (!input.format.empty()) {
    absl::StatusOr<SessionLayout> named = LayoutNamed(input.format);
    if (!named.ok()) return named.status();
    options.layout = *named;
  }
  absl::StatusOr<SessionDirectory> directory = OpenSessionDirectory(input.directory, options);
  if (!directory.ok() || !frames.has_value()) return directory;
  return SelectFrames(*directory, *frames);
}

}  // namespace mapkeep
