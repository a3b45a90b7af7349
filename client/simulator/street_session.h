#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <vector>

#include "client/simulator/session.h"
#include "client/simulator/street.h"
#include "client/simulator/traffic.h"

namespace mapkeep {

/// How a robot drives through a street in one session.
struct DriveParameters {
  SensorModel sensor;  ///< see SensorNamed
  size_t scans = 100;
  double speed = 5;      ///< metres a second
  double start = 0;      ///< metres from the start of the route, [0, ...)
  bool reverse = false;  ///< drives the route the other way round, in the other lane
  bool rolling_shutter = false;
  OdometryParameters odometry;
  TrafficParameters traffic;
};

/// When session `session` begins, seconds since 1970: so many days after 2026-06-01 08:00 UTC.
double StartOfSession(int session);

/// The body sways a little on its springs: two slow waves an axis.
Pose SwayAt(double time, double speed);

/// What is parked, waits to drive off or is built in a street, beside what never changes. The ids that are free for
/// what only passes begin at `next_id`. `robot` is the robot's way in the street's coordinates.
std::vector<SceneObject> StandingIn(const Street& street, int session, const DriveParameters& parameters,
                                    const RobotPath& robot, uint32_t& next_id);

/// INVALID_ARGUMENT naming the parameter that is out of its range.
absl::Status CheckDrive(const DriveParameters& parameters, int session);

/// Session `session` (from 0) of a street. The robot drives along the right lane to the end of the row, turns, comes
/// back in the other lane, turns and goes on; session k begins k days after 2026-06-01 08:00 UTC. What is parked is the
/// street's affair (its seed, its rate of change and the number of the session), what moves is drawn for the session.
/// The truth is in the street's frame, common to its sessions. INVALID_ARGUMENT naming the parameter.
absl::StatusOr<SimulatedSession> DriveThrough(const Street& street, int session, const DriveParameters& parameters);

}  // namespace mapkeep
