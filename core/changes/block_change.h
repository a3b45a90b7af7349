#pragma once

#include "core/voxels/block.h"

namespace mapkeep {

/// What makes a voxel count as changed between two states of a map.
struct ChangeParameters {
  double eta = 1e-3;              ///< eta of eq. 4, scans
  double least_fall = 0.15;       ///< of R, for a voxel that is static in both states to be unstable
  double highest_unstable = 0.9;  ///< R in the later state above it: firm, however far it fell
};

/// What changed in one block. Voxels in order of position, as the state has them that is named. What is new stands like
/// what is static: a change is told at once.
struct BlockChange {
  Block appeared;     ///< stands after, and did not before; as after
  Block disappeared;  ///< the other way round; as before
  Block unstable;     ///< stands in both, not ground, and sessions in between contradicted it: R fell; as after

  bool empty() const { return appeared.voxels.empty() && disappeared.voxels.empty() && unstable.voxels.empty(); }
};

/// Compares two states of a block; nullptr: the map had none there.
BlockChange CompareBlocks(BlockKey key, const Block* before, const Block* after, const ChangeParameters& parameters);

}  // namespace mapkeep
