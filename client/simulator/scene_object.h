#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string_view>

#include "client/simulator/track.h"

namespace mapkeep {

enum class ObjectKind : uint8_t {
  kGround,
  kBuilding,
  kBridge,
  kPole,
  kTree,
  kFence,
  kHedge,
  kFurniture,     ///< bins, benches, signs, bollards
  kConstruction,  ///< containers, scaffolds, hoardings, kiosks: what is built and torn down between sessions
  kCar,
  kLorry,
  kCyclist,
  kPedestrian,
};

std::string_view NameOf(ObjectKind kind);

/// What became of an object in this session, compared with the session before.
enum class ObjectState : uint8_t {
  kStanding,  ///< fixed, there before
  kBuilt,     ///< fixed, not there before
  kTornDown,  ///< fixed, there before, gone now; its track says where it stood
  kParked,    ///< a vehicle that stays in its place all through this session, as in the session before
  kArrived,   ///< parked all through this session, not there at all before
  kMoved,     ///< parked all through this session, elsewhere in the session before
  kLeft,      ///< parked in the session before, gone now; its track says where it stood
  kMoving,    ///< moves at some time of this session
};

std::string_view NameOf(ObjectState state);

/// Whether an object in this state can be hit by a ray in this session.
constexpr bool IsThere(ObjectState state) { return state != ObjectState::kTornDown && state != ObjectState::kLeft; }

/// Something that stands or moves in the street during one session.
struct SceneObject {
  uint32_t id = 0;  ///< the same in every session of a street; unique; not 0
  ObjectKind kind = ObjectKind::kFurniture;
  ObjectState state = ObjectState::kStanding;
  uint32_t mesh = 0;  ///< of the caster's meshes
  Track track;
  std::optional<Pose> previous;  ///< where a kMoved object stood in the session before
};

}  // namespace mapkeep
