#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <map>
#include <span>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/scan.h"
#include "core/registration/windows.h"

namespace mapkeep {

/// Makes the query submaps Q_u of eq. 1 from a session that need not fit in memory: scans are read once as the windows
/// advance, thinned, and dropped when the windows have passed them.
class QueryBuilder {
 public:
  /// `poses` must outlive the builder. Scans and submaps are thinned to `voxel` metres.
  QueryBuilder(ScanSource scans, std::span<const Pose> poses, double voxel)
      : scans_(std::move(scans)), poses_(poses), voxel_(voxel) {}

  /// Q_u: the window's points in the frame of its first scan. Errors of the source are passed on, that of the first
  /// scan if several fail.
  absl::StatusOr<std::vector<Eigen::Vector3d>> QueryOf(const Window& window);

 private:
  absl::Status Load(const Window& window);

  ScanSource scans_;
  std::span<const Pose> poses_;
  double voxel_;
  std::map<size_t, std::vector<Eigen::Vector3f>> thinned_;  // sensor frame, by scan
};

}  // namespace mapkeep
