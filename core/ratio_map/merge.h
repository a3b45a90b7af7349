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
  /// Scans that looked through a voxel of which the session keeps no point, from which on alpha_v is
  /// contradicted_alpha: where nothing is any more, few looks say as much as many, and what stood there for weeks is no
  /// reason to doubt it. 0: eq. 8 decides that, too.
  int contradicting_scans = 3;
  double contradicted_alpha = 0;
  double contradicted_share = 0.6;    ///< of the voxels around one that says nothing, for it to be forgotten with them
  double contradiction_reach = 0.46;  ///< metres around it, 2.3 voxels at least
  /// Share of what one session was the first to see around a voxel that a later one has to look through for all of that
  /// to be forgotten, what no ray passes too (core/ratio_map/cohorts); above 1: never.
  double cohort_looked_through = 0.05;
  double cohort_met = 0.15;   ///< share of it that it may meet at most: another car stands there
  double cohort_reach = 1.6;  ///< metres around it, in cells of half of that
  /// Share of the voxels of a new thing beside which the session removed something, above which it is what removal left
  /// of what moved, and not merged (core/ratio_map/remnants); 1: everything is merged.
  double remnant_share = 0.6;
};

/// Whether the session looked through the voxel and met nothing there that stays: what removal took is gone as well.
bool IsContradicted(const SessionVoxel& session, const MergeParameters& parameters);

/// alpha_v of eq. 8 for N_S scans of evidence; the exponential comes from a table, so that every machine agrees (it is
/// within 4e-5 of the true one). alpha_min if n_max is 0 and n_session is not.
double DecayFactor(double n_session, double n_max, const MergeParameters& parameters);

/// Eq. 9 and the field rules of the design's section 3 on one block: `old` is the map's block (empty voxels if it has
/// none), `session` the session's voxels of that block, sorted. A voxel whose H falls below 1/4 scan is dropped; a
/// voxel never hit is not made. The static flags are carried over, for the map filter to renew. A voxel of which the
/// session says nothing stays as it is.
///
/// Per voxel, with w = alpha H_old: if H_S = 0 only H and E change. Otherwise mean, normal and intensity are averages
/// with the weights w and H_S (opposite normals that cancel: the heavier one); ground is the session's; the mask is the
/// session's if H_S >= w, else the union; first and last seen widen to the session's start.
///
/// What the stored counts lose. They are 16 bits of 1/8 scan, rounded half to even after eq. 9, so
/// - each merge is off by up to 1/16 scan in H and in E, and with alpha = 0.95 a count of 1 1/4 scans or less no longer
///   decays at all: it rounds back to itself;
/// - a count beyond 8191 scans does not fit. Then H and E are both halved until they do: R stays (within rounding), but
///   the voxel's history weighs half as much in later merges, so that it can be forgotten sooner, and N is no longer a
///   number of scans;
/// - a voxel below 1/4 scan is dropped with all it knew, its first_seen too.
Block MergeBlock(const Block& old, std::span<const SessionVoxel> session, const SessionMap& of,
                 const MergeParameters& parameters);

}  // namespace mapkeep
