#pragma once

#include <cstdint>

#include "client/simulator/mesh.h"

namespace mapkeep {

/// A house whose front is the plane y = 0 from x = -width/2 to width/2, its body at y > 0 and its pavement at z = 0.
/// The front has relief: recessed windows and doors, sills, cornices, balconies with railings, a drainpipe, awnings.
/// `seed` chooses all but the width; the house reaches 2.5 m below the ground, so that it may stand on a slope.
TriangleMesh MakeBuilding(float width, float depth, uint64_t seed);

/// Storeys of a car park over one another, open at all sides: slabs on columns with parapets, a back wall and a stair
/// tower. x from -width/2 to width/2, y from 0 to depth, floors at z = 0, storey, 2 storeys ...
TriangleMesh MakeCarDecks(float width, float depth, float storey, int decks);

}  // namespace mapkeep
