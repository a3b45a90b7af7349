#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "client/simulator/ground.h"
#include "client/simulator/ray_caster.h"
#include "client/simulator/scene_object.h"

namespace mapkeep {

/// What makes a row of streets.
struct StreetParameters {
  uint64_t seed = 1;
  int streets = 1;           ///< blocks of 100 m in a row, each from a seed of its own, all of them driven through
  bool repeated = false;     ///< every street is a copy of the first: facades that look alike
  bool level = false;        ///< straight and level, with crossings that are open: a row of a city, see city.h
  double occupancy = 0.6;    ///< share of parking places taken, [0, 1]
  double change_rate = 0.3;  ///< share of parked vehicles that are elsewhere in the next session, [0, 1]; half of them
                             ///< stay in the street. Half this share of the building sites changes
  int waiting_cars = 1;      ///< cars a street that are parked when a session begins and drive off during it
  /// The session, from 0, from which on an extension stands beside a house of the first street, in the park; nothing:
  /// it is never built.
  std::optional<int> extension_from;
  /// The session from which on the fence of the first street's park is gone; nothing: it stays.
  std::optional<int> fence_until;
};

/// Something that is built or torn down once.
struct PlannedObject {
  SceneObject object;
  std::optional<int> from;   ///< the first session in which it stands; nothing: always did
  std::optional<int> until;  ///< the first session in which it is gone; nothing: it stays
};

/// Meshes that many objects share, by their index in the caster.
struct SharedMeshes {
  std::vector<uint32_t> cars, lorries, cyclists, pedestrians, constructions;
};

/// What does not change from session to session, made ready for casting. Copies share the meshes.
struct Street {
  StreetParameters parameters;
  Ground ground;
  RayCaster caster;
  SharedMeshes shared;
  std::vector<SceneObject> fixed;  ///< ids from 1
  std::vector<PlannedObject> planned;
  uint32_t next_id = 1;  ///< the first id that is free for what changes
};

/// A street that is not ready for casting yet; mesh indices are those of `meshes`.
struct StreetParts {
  Ground ground;
  std::vector<TriangleMesh> meshes;
  SharedMeshes shared;
  std::vector<SceneObject> fixed;      ///< ids from 1
  std::vector<PlannedObject> planned;  ///< without ids
};

/// INVALID_ARGUMENT naming the parameter that is out of its range.
absl::StatusOr<StreetParts> BuildStreet(const StreetParameters& parameters);
absl::StatusOr<Street> MakeStreet(const StreetParameters& parameters);

}  // namespace mapkeep
