#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <vector>

#include "client/simulator/ray_caster.h"
#include "client/simulator/session.h"
#include "client/simulator/street.h"
#include "client/simulator/street_session.h"

namespace mapkeep {

/// A small city: two streets along x and two along y that cross, a block of 100 m between them, and 100 m more of each
/// street outside. Each street is a row as in street.h, with its own houses, parking places and traffic.
struct City {
  struct Row {
    Street street;
    Pose place = Pose::Identity();  ///< the city's frame from the street's
  };
  uint64_t seed = 1;
  RayCaster caster;  ///< holds the meshes of all rows, whose objects refer to them
  std::vector<Row> rows;
};

/// `parameters.streets`, `repeated` and `level` are the city's own affair, and it knows no extension_from or
/// fence_until. INVALID_ARGUMENT naming the parameter.
absl::StatusOr<City> MakeCity(const StreetParameters& parameters);

/// Metres of one round along the middle of the roads, corners cut by their turns.
double LengthOfRound();

/// Session `session` (from 0) in a city. The robot drives round the block in the right lane, counter-clockwise
/// (`parameters.reverse`: clockwise), `parameters.start` metres from the middle of the southern street's first
/// crossing. The rest as DriveThrough. Stop-and-go traffic is not for cities and is refused.
absl::StatusOr<SimulatedSession> DriveThroughCity(const City& city, int session, const DriveParameters& parameters);

}  // namespace mapkeep
