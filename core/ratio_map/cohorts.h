#pragma once

#include <cstdint>
#include <vector>

#include "core/ratio_map/contradiction.h"
#include "core/ratio_map/merge.h"
#include "core/voxels/block.h"

namespace mapkeep {

/// The positions of the voxels of the map's centre block that are forgotten with their cohort: what one session was
/// the first to see, within `merge.cohort_reach`. What came together leaves together: where a session looks through
/// some of a cohort, once is enough, and meets next to nothing of it, it is gone, whatever hides the rest, such as the
/// car that is parked there now. A few rays a session, too few to contradict any one voxel, say that of a car far away.
/// Ground that came with it and that the session did not meet, such as the lower edge of a car, goes with it; it is not
/// counted. `map` as before the merge. Sorted.
std::vector<uint16_t> ForgottenWithCohort(const BlockNeighbourhood& map, const SessionNeighbourhood& session,
                                          double voxel_size, const MergeParameters& parameters);

}  // namespace mapkeep
