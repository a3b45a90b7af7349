#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/voxels/block.h"

namespace mapkeep {

/// The maintained map's own filter (paper section 3.4, last paragraph): the rules of removal on the stored statistics.
struct MapFilterParameters {
  double voxel_size = 0.2;            ///< metres, the map's
  double eta = 1e-3;                  ///< eta of eq. 4, scans
  double stability_threshold = 0.25;  ///< R below it: not static, unless ground or in a cluster that is
  double candidate_threshold = 0.4;   ///< R below it, and not ground: takes part in the clusters
  double cluster_radius = 0.5;        ///< epsilon of DBSCAN, metres
  int cluster_min_neighbours = 5;     ///< N_min of DBSCAN
  double cluster_threshold = 0.3;     ///< tau_cluster of eq. 5: a cluster whose mean R is below it is not static
  int isolated_min_neighbours = 1;    ///< occupied 26-neighbours below which a voxel is isolated noise
  /// What one session alone has hit, at most this high above ground that was known before, and that touches nothing
  /// that was, waits for a second session: that place had been seen free. Metres; 0: nothing waits, whatever the rules
  /// of core/ratio_map/probation.
  double probation_height = 3;
  /// Of that, what is wider than this across the ground, as far as it hangs together, does not wait: a car is where it
  /// was parked today, while a person who stood there all the time is not in the map. Metres, at most 12 voxels outside
  /// a block count; 0: however wide, it waits.
  double probation_width = 2.4;
  /// What one session alone has met in at most so many scans, and that touches neither what was known nor what twice as
  /// many met, waits too, however wide, where the map knew anything near. 0: none does.
  int probation_hits = 1;
  /// What stands within so many metres on two of four sides of a voxel that no session has met since, or on one of one
  /// that was ever looked through: the voxel is inside something newer, and gone. 0: nothing is.
  double enclosure_reach = 2.4;
};

/// What the map filter holds a voxel to be.
enum class MapVerdict : uint8_t {
  kGone,  ///< it moved, it is no longer there, or it is noise
  kNew,   ///< static, if a second session meets it
  kStatic,
};

/// The verdict on every voxel of the centre block (present), in its order. A pure function of the 27 blocks' counts,
/// means, times and ground flags (not of their earlier verdicts), so that filtering what a commit touched and its
/// neighbours equals filtering the whole map.
std::vector<MapVerdict> FilterBlock(const BlockNeighbourhood& blocks, const MapFilterParameters& parameters);

}  // namespace mapkeep
