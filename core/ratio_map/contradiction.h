#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/ratio_map/merge.h"
#include "core/ratio_map/session_map.h"
#include "core/voxels/block.h"

namespace mapkeep {

/// A session's voxels in a block and its 26 neighbours, in the order of NeighbourhoodOf, each sorted by key.
using SessionNeighbourhood = std::array<std::span<const SessionVoxel>, 27>;

/// The positions of the voxels of the map's centre block that are forgotten with what was around them. A session that
/// looks through a car that left contradicts what it looks through: the far side, the wheels and what else no ray
/// passes would stand there for days. So does what the session said too little about, if of all that the map or the
/// session has around it (`merge.contradiction_reach`) a share was contradicted (`merge.contradicted_share`). Ground is
/// neither forgotten so nor counted. `map` as before the merge. Sorted.
std::vector<uint16_t> ForgottenWithOthers(const BlockNeighbourhood& map, const SessionNeighbourhood& session,
                                          double voxel_size, const MergeParameters& parameters);

}  // namespace mapkeep
