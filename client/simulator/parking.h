#pragma once

#include <vector>

#include "client/simulator/scene_object.h"
#include "client/simulator/street.h"

namespace mapkeep {

/// A vehicle in its parking place in one session. Its object's track is where it stands when the session begins.
struct ParkedVehicle {
  SceneObject object;
  ParkingSlot slot;
  bool drives_off = false;  ///< during this session; it is gone in the next, without being kLeft there
};

/// What changes between sessions, in one of them.
struct Occupancy {
  std::vector<ParkedVehicle> vehicles;     ///< kParked, kArrived, kMoved, and kLeft for what is gone
  std::vector<SceneObject> constructions;  ///< kStanding, kBuilt, and kTornDown for what is gone; planned ones too
  uint32_t next_id = 1;                    ///< free for what only passes
};

/// The state of a street in session `session`, from 0. A vehicle that leaves frees its slot; whoever comes takes one
/// that was free in the session before, so that no vehicle stands just where another has left. Ids go with the vehicle.
Occupancy OccupancyOf(const Street& street, int session);

}  // namespace mapkeep
