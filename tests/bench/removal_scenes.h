#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "client/simulator/session.h"

namespace mapkeep {

/// One simulated session on which removal is scored, and the voxels that it is cleaned with.
struct RemovalScene {
  std::string name;
  std::string sensor = "hdl64";
  double voxel_size = 0.2;  ///< metres
  size_t scans = 120;
  double speed = 5;  ///< metres a second
  double start = 0;  ///< metres along the route
  uint64_t seed = 1;
  double position_noise = 0;          ///< metres an axis, of each pose
  double rotation_noise_degrees = 0;  ///< an axis, of each pose
  int crowd = 12;
  double density = 1;  ///< of the traffic
  bool stop_and_go = false;
  int waiting_cars = 1;
  double wait = 20;       ///< seconds until they leave
  bool car_park = false;  ///< several storeys, instead of a street
};

/// The twelve scenes: four sensors, voxels of 0.1, 0.2 and 0.4 m, poses that are exact, 3 cm or 0.1 degree off,
/// crowds, stop-and-go traffic, cars that wait 20 s and leave, a standing robot, two storeys.
std::vector<RemovalScene> RemovalScenes();

/// Everything that decides the scene's points, as text: what is kept of it is good for as long as this is the same.
std::string DescriptionOf(const RemovalScene& scene);

absl::StatusOr<SimulatedSession> SimulateScene(const RemovalScene& scene);

}  // namespace mapkeep
