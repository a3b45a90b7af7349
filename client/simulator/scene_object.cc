#include "client/simulator/scene_object.h"

namespace mapkeep {

std::string_view NameOf(ObjectKind kind) {
  switch (kind) {
    case ObjectKind::kGround:
      return "ground";
    case ObjectKind::kBuilding:
      return "building";
    case ObjectKind::kBridge:
      return "bridge";
    case ObjectKind::kPole:
      return "pole";
    case ObjectKind::kTree:
      return "tree";
    case ObjectKind::kFence:
      return "fence";
    case ObjectKind::kHedge:
      return "hedge";
    case ObjectKind::kFurniture:
      return "furniture";
    case ObjectKind::kConstruction:
      return "construction";
    case ObjectKind::kCar:
      return "car";
    case ObjectKind::kLorry:
      return "lorry";
    case ObjectKind::kCyclist:
      return "cyclist";
    case ObjectKind::kPedestrian:
      return "pedestrian";
  }
  return "unknown";
}

std::string_view NameOf(ObjectState state) {
  switch (state) {
    case ObjectState::kStanding:
      return "standing";
    case ObjectState::kBuilt:
      return "built";
    case ObjectState::kTornDown:
      return "torn_down";
    case ObjectState::kParked:
      return "parked";
    case ObjectState::kArrived:
      return "arrived";
    case ObjectState::kMoved:
      return "moved";
    case ObjectState::kLeft:
      return "left";
    case ObjectState::kMoving:
      return "moving";
  }
  return "unknown";
}

}  // namespace mapkeep
