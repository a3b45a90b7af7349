#pragma once

#include <cstdint>
#include <span>

#include "core/ratio_map/session_map.h"
#include "core/voxels/block.h"

namespace mapkeep {

/// The decay rule of eq. 8.
struct MergeParameters {
  double gamma =
      4.0;  ///< gamma: decay sensitivity. One contrary session of equal weight hides a voxel if exp(-gamma) < 0.54
  double alpha_min = 0.1;   ///< alpha_min
  double alpha_max = 0.95;  ///< alpha_max
};

/// alpha_v of eq. 8 for N_S scans of evidence; the exponential comes from a table, so that every machine agrees.
double DecayFactor(double n_session, double n_max, const MergeParameters& parameters);

/// Eq. 9 and the field rules of the design's section 3 on one block: `old` is the map's block (empty voxels if it has
/// none), `session` the session's voxels of that block, sorted. A voxel whose H falls below 1/4 scan is dropped; a
/// voxel never hit is not made. The static flags are carried over, for the map filter to renew.
Block MergeBlock(const Block& old, std::span<const SessionVoxel> session, const SessionMap& of,
                 const MergeParameters& parameters);

}  // namespace mapkeep
