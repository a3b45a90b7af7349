#pragma once

#include <cstdint>

#include "client/simulator/mesh.h"

namespace mapkeep {

// Meshes of what stands along a street; the origin is on the ground. What has a front shows it to -y.

TriangleMesh MakeTree(uint64_t seed);      ///< trunk, branches and a crown of loose leaves that rays pass through
TriangleMesh MakeLampPost(uint64_t seed);  ///< its arm reaches to -y
TriangleMesh MakeSign(uint64_t seed);      ///< a plate on a pole
TriangleMesh MakeBollard(uint64_t seed);   ///< or a bin, or a hydrant
TriangleMesh MakeBench(uint64_t seed);

/// Pickets with gaps on two rails, along x from 0 to `length`.
TriangleMesh MakeFence(float length, uint64_t seed);
/// A dense core in loose leaves, along x from 0 to `length`, about 1.2 m tall.
TriangleMesh MakeHedge(float length, uint64_t seed);
/// Something that stands for some weeks: a container, a kiosk, a hoarding or a scaffold, 3-6 m along x, its middle at
/// 0.
TriangleMesh MakeConstruction(uint64_t seed);

}  // namespace mapkeep
