#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapkeep {

/// Where a first scan was taken: position relative to the map's origin, metres, and yaw, radians.
struct KnownStart {
  double x = 0, y = 0, z = 0;
  double yaw = 0;
};

/// Where GNSS says that the sensor was at the first scan: metres in the map's CRS.
struct GnssStart {
  double x = 0, y = 0, z = 0;
  double level_sigma = 0, height_sigma = 0;  ///< deviations of x and y each, and of z, metres
};

/// A session as the server tells of it; see proto/mapkeep/v1/session_service.proto.
struct SessionInfo {
  enum class State : uint8_t { kUnknown, kUploading, kQueued, kRunning, kCommitted, kRefused, kFailed, kRolledBack };

  /// One registration window (eq. 1).
  struct Window {
    uint32_t first_scan = 0, last_scan = 0;  ///< both inclusive
    double fitness = 0;                      ///< share of its points within tau_d of the map
    uint32_t inliers = 0;
    double correction = 0;     ///< metres that refinement moved it
    double rotation = 0;       ///< radians that refinement turned it
    double observability = 0;  ///< [0, 1]: how well the surroundings fix the weakest direction; near 0 one is open
    double precision = 0;      ///< share of the inliers that lie on a surface of the map
    double coverage = 0;       ///< share of its points where the map knows anything
    bool trusted = false;
  };

  struct StageSeconds {
    std::string stage;
    double seconds = 0;
  };

  /// What the pipeline found out; complete once the session has ended.
  struct Report {
    std::vector<Window> windows;
    std::vector<StageSeconds> stages;
    uint64_t points = 0, points_removed = 0, points_restored = 0;
    uint64_t session_voxels = 0;                  ///< that the session saw
    uint64_t voxels_kept = 0, static_voxels = 0;  ///< after the merge, in the blocks that it touched
    uint64_t blocks_touched = 0;
    uint64_t base_epoch = 0, epoch = 0;  ///< aligned to, and made by the commit
  };

  std::string map, id, robot;
  State state = State::kUnknown;
  uint32_t scan_count = 0;
  uint32_t durable_scans = 0;  ///< scans [0, durable_scans) are safe on the server
  bool keep_scans = false;
  double created = 0, ended = 0, start_time = 0;  ///< seconds since 1970 (UTC), 0: not yet, or unknown
  std::string stage;                              ///< at work while running
  double stage_progress = 0;                      ///< [0, 1]
  std::string reason;                             ///< why it was refused or failed
  uint64_t payload_bytes = 0;                     ///< of the durable scans, as they were sent
  std::optional<Report> report;
};

/// "uploading", "queued", "running", "committed", "refused", "failed" or "rolled back".
std::string_view NameOf(SessionInfo::State state);

/// Whether a session in this state is over.
constexpr bool HasEnded(SessionInfo::State state) { return state >= SessionInfo::State::kCommitted; }

}  // namespace mapkeep
