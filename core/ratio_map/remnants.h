#pragma once

#include <cstdint>
#include <vector>

#include "core/ratio_map/contradiction.h"
#include "core/ratio_map/merge.h"
#include "core/voxels/block.h"

namespace mapkeep {

/// The positions in the centre block, sorted, of what a session kept of something that moved, where the map knows
/// better: it hangs together (gaps of one voxel are none), neither is in the map nor touches what is, but for the
/// ground, and of more than `merge.remnant_share` of its voxels a neighbour was removed whole. A car that stood through
/// half of a session and drove off, somebody who waited: what removal leaves of them is no news. It is not to be
/// merged; if it is real, the next session brings it. None where the map has no block yet. `map` as before the merge.
std::vector<uint16_t> RemnantsIn(const BlockNeighbourhood& map, const SessionNeighbourhood& session,
                                 const MergeParameters& parameters);

}  // namespace mapkeep
