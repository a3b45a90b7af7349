#include "client/cli/session_input.h"

#include <optional>

#include "client/readers/frames.h"

namespace mapkeep {

void AddSessionInput(CLI::App& command, SessionInput& input) {
  command.add_option("DIR", input.directory, "Session directory")->required();
  command.add_option("--format", input.format, "Layout of DIR: kitti, elite or kth; by default told by its folders")
      ->type_name("LAYOUT");
  command.add_option("--frames", input.frames, "Only these scans, both ends included, counted from 0")
      ->type_name("FIRST:LAST[:STEP]");
}

absl::StatusOr<SessionDirectory> OpenSessionInput(const SessionInput& input) {
  std::optional<FrameRange> frames;
  if (!input.frames.empty()) {
    absl::StatusOr<FrameRange> parsed = ParseFrames(input.frames);
    if (!parsed.ok()) return parsed.status();
    frames = *parsed;
  }
  std::optional<SessionLayout> layout;
  if (!input.format.empty()) {
    absl::StatusOr<SessionLayout> named = LayoutNamed(input.format);
    if (!named.ok()) return named.status();
    layout = *named;
  }
  absl::StatusOr<SessionDirectory> directory = OpenSessionDirectory(input.directory, layout);
  if (!directory.ok() || !frames.has_value()) return directory;
  return SelectFrames(*directory, *frames);
}

}  // namespace mapkeep
