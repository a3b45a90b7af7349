#include "client/readers/deskew.h"

#include <absl/strings/str_format.h>

#include <cmath>
#include <optional>
#include <utility>

#include "client/readers/session_directory.h"

namespace mapkeep {
namespace {

/// A thousandth of a second at 30 m/s is 3 cm; a tenth of that is beyond what a LiDAR resolves.
constexpr double kStep = 1e-4;

}  // namespace

absl::Status Deskew(const PoseTrack& track, double time, const std::vector<float>& offsets, Scan* scan) {
  const std::optional<Pose> start = track.Near(time, kBeyondTrack);
  if (!start.has_value()) return absl::InvalidArgumentError(absl::StrFormat("there is no pose at %.3f s", time));
  const Pose back = start->inverse();
  // Points of one firing share their time, and those of the next one nearly so.
  std::optional<std::pair<int64_t, Pose>> last;
  for (size_t i = 0; i < scan->points.size(); ++i) {
    // What is no return stays what it is.
    if (!(scan->points[i].norm() >= kNoReturnRange)) continue;
    if (!std::isfinite(offsets[i])) {
      return absl::InvalidArgumentError(absl::StrFormat("the time of point %d is not finite", i));
    }
    const auto step = static_cast<int64_t>(std::llround(offsets[i] / kStep));
    if (!last.has_value() || last->first != step) {
      const double at = time + static_cast<double>(step) * kStep;
      const std::optional<Pose> pose = track.Near(at, kBeyondTrack);
      if (!pose.has_value()) {
        return absl::InvalidArgumentError(absl::StrFormat(
            "point %d was measured %.3f s from its scan's time, where there is no pose", i, offsets[i]));
      }
      last = {step, back * *pose};
    }
    scan->points[i] = (last->second * scan->points[i].cast<double>()).cast<float>();
  }
  return absl::OkStatus();
}

}  // namespace mapkeep
