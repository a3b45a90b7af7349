#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <string>

#include "client/readers/session_directory.h"

namespace mapkeep {

/// Some scans of a session: first, first + step, ... up to last, counted from 0, both ends included.
struct FrameRange {
  size_t first = 0;
  size_t last = 0;
  size_t step = 1;
};

/// "FIRST:LAST" or "FIRST:LAST:STEP". INVALID_ARGUMENT for anything else, LAST before FIRST, or a STEP of 0.
absl::StatusOr<FrameRange> ParseFrames(const std::string& text);

/// The session of these scans alone. INVALID_ARGUMENT if LAST is beyond the end.
absl::StatusOr<SessionDirectory> SelectFrames(const SessionDirectory& directory, const FrameRange& range);

}  // namespace mapkeep
