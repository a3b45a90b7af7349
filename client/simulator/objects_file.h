#pragma once

#include <absl/status/status.h>

#include <filesystem>

#include "client/simulator/session.h"

namespace mapkeep {

/// Writes what stands where in a session as one JSON object:
///
///     {"format": 1, "frame": "truth", "start": S, "duration": S, "objects": [...]}
///
/// An object has `id`, `kind` and `state` (see NameOf), `centre` [x, y, z] and `orientation` [qw, qx, qy, qz] of its
/// box when the session begins (when it first appears, if that is later; where it was, for what has left or was torn
/// down) in the frame of truth_poses.txt, and the box's `size` [x, y, z] in metres. A moved one has `previous_centre`
/// and `previous_orientation`, one that moves `track`: rows [seconds since the start, x, y, z] of the box's centre, one
/// a second.
absl::Status WriteObjects(const std::filesystem::path& path, const SimulatedSession& session);

}  // namespace mapkeep
