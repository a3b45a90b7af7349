#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/ratio_map/contradiction.h"
#include "core/ratio_map/merge.h"
#include "core/voxels/block.h"

namespace mapkeep {

/// What a session says has left a block of the map: positions, sorted.
struct Departed {
  std::vector<uint16_t> forgotten;     ///< with others (contradiction) or with its cohort (cohorts): not to be merged
  std::vector<uint16_t> contradicted;  ///< looked through: eq. 8's affair, with contradicted_alpha
};

/// Of the centre block. `map` as before the merge.
Departed DepartedFrom(const BlockNeighbourhood& map, const SessionNeighbourhood& session, double voxel_size,
                      const MergeParameters& parameters);

/// The map's block as eq. 9 may take it: without what is forgotten; and where something left beside a voxel that the
/// session met, without the parts of that voxel that were occupied, since they may have been of what left (the lower
/// edge of a car in the voxels of the road): the session says which are. `departed`: of the block and its 26
/// neighbours, in the order of NeighbourhoodOf; nullptr where the session says nothing.
Block Remembered(const Block& block, const std::array<const Departed*, 27>& departed,
                 std::span<const SessionVoxel> session);

}  // namespace mapkeep
