#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/progress.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// Every parameter of registration, with the symbol of the paper's section 3.2.
struct AlignParameters {
  int window_scans = 30;               ///< L: scans of a window
  double window_travel = 15.0;         ///< metres of travel after which a window ends before L scans
  int window_stride = 10;              ///< r: scans between the starts of windows
  double source_voxel = 0.3;           ///< metres: query submaps are thinned to this
  double coarse_correspondence = 2.0;  ///< metres: largest distance of a match in the first GICP round
  double fine_correspondence = 1.0;    ///< metres: in the last
  double inlier_distance = 0.5;        ///< tau_d, metres
  double min_fitness = 0.75;           ///< tau_f, after refinement
  int min_inliers = 100;               ///< matched points below which a window says nothing
  double max_correction = 3.0;         ///< metres that refinement may move a window from its prior
  double max_rotation = 0.1;           ///< radians, likewise
  double min_observability = 0.01;     ///< of Fit::observability: below it the surroundings leave a direction open
  double coarse_robust_width = 0.5;    ///< metres off a surface at which a pair counts half in the first round
  double fine_robust_width = 0.1;      ///< in the last
  int max_iterations = 30;             ///< of GICP, a round
  double max_tilt = 5.0;               ///< degrees that z may be off the up direction in a session that founds a map
};

/// The registration target C_{t-1}: the map's static voxels near the session. Columns of equal length.
struct RegistrationTarget {
  double voxel_size = 0;                 ///< metres, the map's
  std::vector<Eigen::Vector3d> points;   ///< mean points, map frame
  std::vector<Eigen::Vector3d> normals;  ///< unit, or zero where unknown
};

/// What became of one window W_u (eq. 1).
struct WindowResult {
  uint32_t first_scan = 0, last_scan = 0;  ///< inclusive
  double fitness = 0;                      ///< f_u: share of query points within tau_d of the target
  uint32_t inliers = 0;
  double correction = 0;     ///< metres between the prior and the refined pose
  double rotation = 0;       ///< radians between them
  double observability = 0;  ///< how well its surroundings fix the weakest direction (core/registration/fitness.h)
  bool trusted = false;
};

struct Alignment {
  bool accepted = false;
  std::string reason;       ///< why it was refused; empty if accepted
  std::vector<Pose> poses;  ///< T^_{t,i}: one a scan, map frame; empty if refused
  std::vector<WindowResult> windows;
};

/// Aligns a session to the map from the poses as given: GICP refinement of every window against the target, tracked
/// from window to window, verified by fitness; scan poses fused from the trusted windows that cover them (eq. 2) and
/// interpolated between. A session that no window places is refused with the reason: not an error. Deterministic on any
/// number of threads. INVALID_ARGUMENT for counts that do not match; errors of the source are passed on.
absl::StatusOr<Alignment> AlignSession(const ScanSource& scans, std::span<const Pose> poses,
                                       const RegistrationTarget& target, const AlignParameters& parameters,
                                       const Progress& progress = {});

/// The session that founds a map: its poses as given are the map frame. Refused if its ground and walls say that z is
/// not up within 5 degrees.
absl::StatusOr<Alignment> FoundMapFrame(const ScanSource& scans, std::span<const Pose> poses,
                                        const AlignParameters& parameters, const Progress& progress = {});

}  // namespace mapkeep
