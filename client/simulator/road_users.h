#pragma once

#include <cstdint>

#include "client/simulator/mesh.h"

namespace mapkeep {

// Meshes of what moves: x forward, z up, the origin on the ground below the middle. `seed` chooses sizes and colours.

TriangleMesh MakeCar(uint64_t seed);         ///< hatchback, saloon or van, 3.9-5.2 m
TriangleMesh MakeLorry(uint64_t seed);       ///< cab and box, 7-10 m
TriangleMesh MakeCyclist(uint64_t seed);     ///< bicycle and rider
TriangleMesh MakePedestrian(uint64_t seed);  ///< 1.55-1.9 m tall, in mid-stride

}  // namespace mapkeep
