#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "client/simulator/scene_object.h"
#include "client/simulator/street.h"

namespace mapkeep {

/// What moves in a street during a session.
struct TrafficParameters {
  double density = 1;        ///< of all that passes; 0: nothing moves but the cars that drive off
  int crowd = 12;            ///< people of a crowd, one crowd a street
  bool stop_and_go = false;  ///< everybody on the road stops and starts, the robot too
  double wait = 20;          ///< seconds until a waiting car drives off; half the session if that is shorter
};

/// Where the robot is in street coordinates.
struct RobotPlace {
  double s = 0, d = 0, yaw = 0;
};
using RobotPath = std::function<RobotPlace(double time)>;

/// The share of its travel at even speed that a vehicle has done at `time` in stop-and-go traffic: seconds in, seconds
/// out.
double StopAndGoTime(double time);

/// Cars, lorries, cyclists, pedestrians and crowds that come near the robot within `duration` seconds. Tracks are kept
/// only for the time in which they are within 160 m of it. Ids from `first_id`.
std::vector<SceneObject> TrafficOf(const Street& street, const TrafficParameters& parameters, const RobotPath& robot,
                                   double robot_speed, double duration, uint64_t seed, uint32_t first_id);

/// The track of a car that stands in `slot` (at the right kerb) and drives off at `time`, or at the time nearest to it,
/// up to `latest`, at which the robot does not just come by; it follows the robot if that drives ahead. It stays if
/// there is no such time.
Track DriveOff(const Street& street, const ParkingSlot& slot, double time, double latest, const RobotPath& robot);

}  // namespace mapkeep
