#pragma once

#include "core/registration/global_matcher.h"
#include "core/registration/plan_search.h"

namespace mapkeep {

/// How scan poses are made from trusted windows.
enum class ScanPoses {
  kPoseGraph,  ///< least squares over windows and odometry
  kFusion,     ///< the paper's eq. 2
};

/// Every parameter of registration, with the symbol of the paper's section 3.2.
struct AlignParameters {
  int window_scans = 30;               ///< L: scans of a window
  double window_travel = 15.0;         ///< metres of travel after which a window ends before L scans
  int window_stride = 10;              ///< r: scans between the starts of windows
  double source_voxel = 0.3;           ///< metres: query submaps are thinned to this
  double query_range = 60.0;           ///< metres: points further from their sensor are not used
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

  double min_precision = 0.62;     ///< Fit::precision of a window, likewise
  double min_coverage = 0.35;      ///< Fit::coverage of a window: below it lies beyond the map
  double first_structure = 0.13;   ///< StructureFit::score of a window that no other one leads to
  double first_fitness = 0.8;      ///< f_u of a window that is found by descriptors, without a prior,
  double first_precision = 0.78;   ///< its precision,
  double first_coverage = 0.4;     ///< and its coverage
  double alias_share = 0.75;       ///< of a place's score: another place that reaches it makes a window ambiguous
  double agree_distance = 0.5;     ///< metres that two windows may disagree by,
  double agree_per_metre = 0.03;   ///< and metres more a metre of travel between them,
  double agree_rotation = 0.02;    ///< radians,
  double agree_turn = 0.0005;      ///< and radians more a metre
  int max_matched_windows = 12;    ///< windows of a session that are matched globally before it is refused
  double prior_reach = 50.0;       ///< metres from a prior within which the matcher looks
  int lost_windows = 3;            ///< windows in a row without trust after which the matcher is asked again
  double min_trusted_share = 0.3;  ///< of the windows inside the map, else the session is refused
  ScanPoses scan_poses = ScanPoses::kPoseGraph;
  PlanSearchParameters plan;
  double plan_rival = 0.65;       ///< of the best place's walls: another place that has as many is refined as well
  bool match_descriptors = true;  ///< where the search from above finds no place at all
  MatcherParameters matcher;
};

}  // namespace mapkeep
