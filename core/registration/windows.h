#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/geometry/pose.h"
#include "core/registration/parameters.h"

namespace mapkeep {

/// A window W_u of eq. 1: consecutive scans, both ends inclusive.
struct Window {
  size_t first = 0, last = 0;
  bool operator==(const Window&) const = default;
};

/// The windows of a session: each of window_scans scans (L) or window_travel metres along the trajectory, whichever
/// ends first, begun every window_stride scans (r) but no later than half a window after the one before, so that they
/// overlap at any speed. The last one ends with the session. Every scan lies in at least one.
std::vector<Window> WindowsOf(std::span<const Pose> poses, const AlignParameters& parameters);

}  // namespace mapkeep
