#pragma once

#include <vector>

#include "core/ratio_map/map_filter.h"
#include "core/voxels/block.h"

namespace mapkeep {

/// Which voxels of the centre block (present), in its order, are inside something newer: on two of four sides
/// (`filter.enclosure_reach`) stands what came after the last session that met them; or on one, if any session ever
/// looked through them (E of one scan). Where a car is parked now, what an earlier one left stands no more, though
/// nobody sees it: two things are not in one place. If the newer one leaves and the older one is met again, it is back.
/// Empty if none is, or the rule is off. A pure function as FilterBlock.
std::vector<bool> Enclosed(const BlockNeighbourhood& blocks, const MapFilterParameters& parameters);

}  // namespace mapkeep
