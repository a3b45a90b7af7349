#pragma once

#include <Eigen/Core>
#include <span>

#include "core/geometry/pose.h"

namespace mapkeep {

/// Where a robot stood at its first scan, in the frame of the map and its origin. Roll and pitch are the odometry's
/// own.
struct InitialPose {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< metres
  double yaw = 0;                                      ///< radians from x towards y
};

/// Moves and turns (about z) the whole trajectory so that it begins there. `poses` is not empty.
void BeginAt(const InitialPose& start, std::span<Pose> poses);

}  // namespace mapkeep
