#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/geometry/pose.h"

namespace mapkeep {

/// How far odometry may be trusted.
struct OdometryParameters {
  double drift = 0;  ///< metres off after 100 m of straight travel: exactly this, in a direction that the seed chooses
  double position_noise = 0;  ///< metres an axis, white, of each pose on its own: does not add up
  double rotation_noise = 0;  ///< radians an axis, likewise
};

/// What odometry makes of a true ride: it begins at an origin of its own with heading zero, tilted as the truth is
/// (gravity is known), and its error grows with the travel. About half of the drift's variance is a bias of speed, the
/// rest turns slowly (yaw, and less pitch), and the bias swings by half with a period of 37 m, as that of real odometry
/// is not constant.
std::vector<Pose> OdometryOf(std::span<const Pose> truth, const OdometryParameters& parameters, uint64_t seed);

}  // namespace mapkeep
