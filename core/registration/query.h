#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <map>
#include <span>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/scan.h"
#include "core/registration/match_cloud.h"
#include "core/registration/windows.h"

namespace mapkeep {

/// Makes the query submaps Q_u of eq. 1 from a session that need not fit in memory: scans are read once as the windows
/// advance, thinned, and dropped when the windows have passed them.
class QueryBuilder {
 public:
  /// `poses` must outlive the builder. Scans and submaps are thinned to `voxel` metres; points further than `range`
  /// metres from their sensor are left out.
  QueryBuilder(ScanSource scans, std::span<const Pose> poses, double voxel, double range)
      : scans_(std::move(scans)), poses_(poses), voxel_(voxel), range_(range) {}

  /// Q_u: the window's points in the frame of its first scan, each facing the sensor that saw it. Errors of the source
  /// are passed on, that of the first scan if several fail.
  absl::StatusOr<FacingPoints> QueryOf(const Window& window);

  /// The thinned points of a scan of the window that was asked for last, sensor frame.
  const std::vector<Eigen::Vector3f>& PointsOf(size_t scan) const { return thinned_.at(scan); }

 private:
  absl::Status Load(const Window& window);

  ScanSource scans_;
  std::span<const Pose> poses_;
  double voxel_;
  double range_;
  std::map<size_t, std::vector<Eigen::Vector3f>> thinned_;  // sensor frame, by scan
};

}  // namespace mapkeep
