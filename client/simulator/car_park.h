#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <vector>

#include "client/simulator/ray_caster.h"
#include "client/simulator/scene_object.h"
#include "client/simulator/session.h"
#include "client/simulator/street_session.h"

namespace mapkeep {

struct CarParkParameters {
  uint64_t seed = 1;
  double occupancy = 0.7;    ///< share of the slots that are taken, [0, 1]
  double change_rate = 0.3;  ///< share of the slots that change hands between sessions, [0, 1]
};

/// A multi-storey car park, 60 x 32 m: two floors over one another and a roof, joined by a ramp in the middle, open at
/// the sides, houses around it. Copies share the meshes.
struct CarPark {
  CarParkParameters parameters;
  RayCaster caster;
  std::vector<SceneObject> fixed;           ///< ids from 1
  std::vector<uint32_t> cars, pedestrians;  ///< meshes
};

/// INVALID_ARGUMENT naming the parameter that is out of its range.
absl::StatusOr<CarPark> MakeCarPark(const CarParkParameters& parameters);

/// Session `session` (from 0) in a car park. The robot drives round the lower floor, up the ramp, round the upper floor
/// and down again, over and over (270 m); two cars drive before and behind it and people walk to theirs.
/// `parameters.reverse` and stop-and-go are not for car parks and are refused.
absl::StatusOr<SimulatedSession> DriveThroughCarPark(const CarPark& car_park, int session,
                                                     const DriveParameters& parameters);

}  // namespace mapkeep
