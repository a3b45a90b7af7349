#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// A world of axis-aligned boxes, metres.
using Scene = std::vector<Eigen::AlignedBox3d>;

/// A street along x with the ground's surface at z = -0.3, walls about it and pillars along it, so that its ground lies
/// in other blocks (of 6.4 m) than what stands on it.
Scene Street();

/// A car that stands alone in block (1, -1, 0), above the ground.
Eigen::AlignedBox3d Car();

/// What a spinning LiDAR at `pose` sees of the scene: one point a ray, at most 40 m away.
Scan CastRays(const Scene& scene, const Pose& pose, double time);

/// One drive, as it is uploaded.
struct Drive {
  std::vector<Scan> scans;
  std::vector<Pose> poses;
};

/// A drive along the street, `scans` scans half a metre apart, one every tenth of a second from `start` (seconds since
/// 1970). `offset` moves the frame of the poses, `along` the drive itself, metres.
Drive DriveAlong(const Scene& scene, int scans, double start, const Eigen::Vector3d& offset = {0, 0, 0},
                 double along = 0);

}  // namespace mapkeep
