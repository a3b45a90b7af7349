#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/geometry/pose.h"

namespace mapkeep {

/// How far odometry may be trusted.
struct OdometryParameters {
  /// Metres off after 100 m of straight travel: exactly this, in a direction that the seed chooses.
  double drift = 0;
  double position_noise = 0;  ///< metres an axis, white, of each pose on its own: does not add up
  double rotation_noise = 0;  ///< radians an axis, likewise
  bool knows_gravity =
      true;  ///< the session's frame has z up, as an inertial unit gives it; else it is the sensor's first
};

/// What odometry makes of a true ride: it begins at the origin and with yaw 0 (with no knowledge of gravity: at the
/// identity), and the error grows with the travel. About half of the drift's variance is a bias of speed, the rest
/// turns slowly (yaw, and less pitch), and the bias swings by half with a period of 37 m, as that of real odometry is
/// not constant.
std::vector<Pose> OdometryOf(std::span<const Pose> truth, const OdometryParameters& parameters, uint64_t seed);

}  // namespace mapkeep
