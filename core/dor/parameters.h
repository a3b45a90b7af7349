#pragma once

#include <absl/status/status.h>

#include <cstdint>

namespace mapkeep {

/// How the voxels that a scan looked through are found. Both see the same but for rays that touch corners.
enum class ExposureEngine : uint8_t {
  kProjection,  ///< asks for every voxel in reach whether a ray of the scan passes through it; the fastest
  kRayWalk,     ///< walks the ray of every point from voxel to voxel: the reference
};

/// How exposures are counted (E of eq. 4). The switches off and a margin of 0 are the paper's count.
struct ExposureParameters {
  ExposureEngine engine = ExposureEngine::kProjection;
  bool sub_voxels = true;  ///< a ray exposes a voxel only where the session has points in it, to a quarter of its edge
  bool neighbour_hits = true;     ///< a voxel is not exposed by a scan that hits one beside it in its layer
  double margin_by_range = 0.02;  ///< the last part of a ray exposes nothing: metres a metre of its length

  /// A ray that sees through a voxel confirms it as a void if all rays of its scan that pass this close to the voxel
  /// end this far behind it: metres. Voxels on surfaces are seen through at grazing angles, but never so. 0 around:
  /// nothing is confirmed.
  double clear_around = 0.2, clear_behind = 0.5;
};

/// How the poses of the scans are refined before removal (RefinePoses).
struct PoseRefinementParameters {
  double cell = 0.5;            ///< metres: edge of the cells in which the session's surface is taken for a plane
  int points = 4096;            ///< of a scan, at most
  int rounds = 3;               ///< times that the planes are taken from the poses of the round before
  double robust_width = 0.1;    ///< metres off its plane at which a point counts a quarter
  double max_correction = 0.3;  ///< metres; a scan that would move farther keeps its pose
  double max_rotation = 0.02;   ///< radians, likewise
  double min_gain = 0.15;  ///< share by which the points must come closer to their planes, or all poses stay as given
};

/// Every parameter of dynamic object removal, with the symbol of the paper's section 3.3.
struct DorParameters {
  double voxel_size = 0.2;            ///< metres
  int window_radius = 0;              ///< k of eq. 3, scans to either side; 0: the whole session
  double eta = 1e-3;                  ///< eta of eq. 4, scans
  double stability_threshold = 0.35;  ///< R below it: a dynamic candidate

  bool refine_poses = true;  ///< whoever has the session removed refines its poses first
  PoseRefinementParameters refinement;

  ExposureParameters exposure;

  bool protect_ground = true;     ///< the ground is never removed for its R
  double ground_slope = 0.9;      ///< tau_slope: |n_z| above it makes a voxel a ground anchor
  double ground_tolerance = 0.2;  ///< delta_ground: voxels this close to the local ground height are ground, metres
  double ground_cell = 0.5;       ///< edge of a cell of the height grid, metres
  double ground_step = 0.3;       ///< ground continues into the next cell if its height differs by less, metres

  bool cluster = true;               ///< decide on DBSCAN clusters (eq. 5), not on single voxels
  double candidate_threshold = 0.6;  ///< R below it: takes part in the clusters
  double cluster_radius = 0.5;       ///< epsilon of DBSCAN, metres
  int cluster_min_neighbours = 5;    ///< N_min of DBSCAN, a voxel counts itself
  double cluster_threshold = 0.35;   ///< tau_cluster: a cluster whose mean R is below it is dynamic

  bool confirm = true;         ///< what is dynamic by its R stays if no confirmed void is near
  int confirmed_scans = 1;     ///< in which a dynamic voxel must have been a confirmed void to count as one
  double confirm_reach = 1.2;  ///< edge of the cells in which, and in whose neighbours, it is looked for, metres

  /// Keep what is dynamic by its R where its own hits and its surroundings (0.5 m) speak for leaves or for a surface at
  /// a grazing angle: if the sum of these weights is above 1.
  bool doubt = true;
  double doubt_hits = 0.067;      ///< a natural logarithm of the scans that hit the voxel
  double doubt_returns = 1.87;    ///< of the share of hits that came after exposures, where R is below the candidates'
  double doubt_stability = 1.33;  ///< of the hits in hits and exposures
  double doubt_voids = 0.667;     ///< of the share of voxels that were confirmed voids: speaks for having moved

  bool departures = true;        ///< find what stood still and then left, or came and stayed, by the order of scans
  int vacated_scans = 4;         ///< scans that look through a voxel after its last hit for it to have been left
  int vacated_neighbours = 10;   ///< voxels of 0.2 m around it that were left at the same time, itself included
  int vacated_confirmed = 3;     ///< or so many that were confirmed as voids in two scans after their last hit
  double departure_reach = 1.6;  ///< metres around those in which the rest of the object is looked for

  bool drive_offs = true;  ///< find what stood until something set out beside it, where nobody looked again
  int setting_out = 7;     ///< scans that it takes for its first two metres at least: what drives by is sooner gone

  bool transients = true;         ///< find what was somewhere for a short while, where it was clear besides
  double transient_reach = 0.5;   ///< metres around a voxel that are one place, 1.5 voxels at least
  int transient_scans = 60;       ///< from the first to the last that hit anything there, at most
  double transient_clear = 0.04;  ///< scans to which it was clear, for each of those and each voxel that was hit

  bool inherit = true;    ///< voxels with little evidence follow those around them
  int decided_scans = 8;  ///< H + E from which a voxel's own evidence decides

  /// Voxels among dynamic ones that were looked through at all, or hit for a part of the time only, are dynamic.
  bool surround = true;
  double surrounded_share = 0.6;  ///< share of the voxels around, without ground, that must be dynamic
  double surrounded_time = 0.7;   ///< share of the time in which anything around was hit, below which it is a part
  double surround_reach = 0.46;   ///< metres around, 2.3 voxels at least, in which the times are compared

  bool verify_ankles = true;      ///< look for feet and wheels in ground voxels under dynamic ones, or looked through
  double ankle_tolerance = 0.06;  ///< delta_tol: their points this far above the ground go, metres

  bool restore = true;  ///< give points of isolated dynamic voxels back with the probability of eq. 6
  uint64_t seed = 0;    ///< of eq. 6, together with voxel, scan and point
};

/// INVALID_ARGUMENT naming the field, its value and its range.
absl::Status CheckParameters(const DorParameters& parameters);

}  // namespace mapkeep
