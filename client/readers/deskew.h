#pragma once

#include <absl/status/status.h>

#include <vector>

#include "client/readers/pose_track.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// Takes the points of a scan to where the sensor was at the scan's own time: each is moved by the sensor's motion
/// between the two. `offsets` are seconds from the scan's time to each point's; `track` is of the sensor. The points
/// may lie up to kBeyondTrack seconds outside the track. INVALID_ARGUMENT naming the first point that does not.
absl::Status Deskew(const PoseTrack& track, double time, const std::vector<float>& offsets, Scan* scan);

inline constexpr double kBeyondTrack = 0.2;  ///< seconds: two scans of 10 a second

}  // namespace mapkeep
