#pragma once

#include <vector>

#include "core/ratio_map/map_filter.h"
#include "core/voxels/block.h"

namespace mapkeep {

/// Which voxels of the centre block (present), in its order, wait for a second session, though nothing speaks against
/// them. All of them were met by one session alone, where earlier ones had met something:
/// - what stands above ground that was known, touches nothing that was, and is narrow (`filter.probation_height`,
///   `filter.probation_width`): somebody had looked over that place and met nothing;
/// - what touches neither what was known nor what many scans met, and few met itself, however wide
///   (`filter.probation_hits`), if the map knew anything within 8 to 16 voxels: what drives past far away leaves that;
/// - ground on top of ground that was known: wheels and feet.
/// Empty if none does, or probation is off. A pure function as FilterBlock.
std::vector<bool> Waiting(const BlockNeighbourhood& blocks, const MapFilterParameters& parameters);

}  // namespace mapkeep
