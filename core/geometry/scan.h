#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace mapkeep {

/// One LiDAR sweep in the sensor frame. Not organised: any order, any pattern.
struct Scan {
  std::vector<Eigen::Vector3f> points;  ///< metres
  std::vector<float> intensities;       ///< one a point, [0, 1]; or empty: unknown
  /// Start of the sweep, seconds: since 1970 (UTC), or since an unknown start (CountsFrom1970). The same in all scans
  /// of a session: unknown.
  double time = 0;
};

/// Whether a time is one of the calendar. Below 2001-09-09 it counts from an unknown start, as KITTI's do.
inline bool CountsFrom1970(double time) { return time >= 1e9; }

/// A sequence of scans that may not fit in memory. `read(i)` gives scan i in [0, count), the same bytes every time, and
/// may be called from several threads at once.
struct ScanSource {
  size_t count = 0;
  std::function<absl::StatusOr<Scan>(size_t index)> read;
};

/// A source over scans held in memory.
ScanSource SourceOf(std::vector<Scan> scans);

/// INVALID_ARGUMENT naming the first point that is not finite, or if there is no point or the intensities do not match.
absl::Status CheckScan(const Scan& scan);

}  // namespace mapkeep
