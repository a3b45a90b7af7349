#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Geometry>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/progress.h"
#include "storage/map_store.h"
#include "storage/session_store.h"

namespace mapkeep {

/// What the pipeline wants to know of every scan before it works on any.
struct SessionOutline {
  std::vector<Pose> poses;                   ///< T_odometry_sensor, as uploaded
  std::vector<Eigen::AlignedBox3d> extents;  ///< of each scan's points and its sensor, metres, sensor frame
  uint64_t points = 0;
};

/// Reads every staged scan once, on the calling oneTBB arena. Errors of `read` are passed on; CANCELLED when `progress`
/// says stop.
absl::StatusOr<SessionOutline> ReadOutline(size_t count, const std::function<absl::StatusOr<StagedScan>(size_t)>& read,
                                           const Progress& progress = {});

/// The blocks that the rays of each scan can touch, grown by `margin` metres: a box a scan, since a box that holds the
/// sensor and every point also holds every ray.
std::vector<BlockRange> ReachOf(const SessionOutline& outline, std::span<const Pose> poses, double voxel_size,
                                double margin);

/// The blocks that a box touches, metres.
BlockRange BlocksOf(const Eigen::AlignedBox3d& box, double voxel_size);

/// Keys of the snapshot's blocks that lie in one of the ranges, in order.
absl::StatusOr<std::vector<BlockKey>> BlocksWithin(const Snapshot& snapshot, std::span<const BlockRange> ranges);

/// The origin that a map takes from the session that founds it: none if the first pose is within 10 km of zero,
/// otherwise its position rounded to 100 m. Metres.
std::optional<Eigen::Vector3d> OriginFor(const Pose& first);

}  // namespace mapkeep
