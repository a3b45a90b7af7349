#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/geometry/pose.h"
#include "core/registration/descriptors.h"
#include "core/registration/match_cloud.h"
#include "core/registration/matching.h"

namespace mapkeep {

/// Every parameter of the global matcher (KISS-Matcher, Lim et al., 2025, and what design section 5 measured). Lengths
/// "in voxels" are multiples of the voxel size v that a target was prepared with.
struct MatcherParameters {
  double normal_radius = 3.0;      ///< voxels: neighbours that make a normal
  double descriptor_radius = 5.0;  ///< voxels: neighbours that make a descriptor, at most kCellVoxels
  double max_flatness = 1.0;  ///< share of a neighbourhood that looks like one plane, above which a point is no feature
  MatchingParameters matching;
  double graph_bound = 1.0;    ///< voxels: error of a match that the compatibility graph allows
  double solver_bound = 0.75;  ///< voxels: error of a match that the solver for rotation and translation allows
  double inlier_bound = 1.0;   ///< voxels: error of a match that counts as inlier of the pose fitted at last
  double gnc_factor = 1.4;     ///< growth of the non-convexity of the rotation solver a step
  int max_cores = 5;           ///< cores of the graph that are tried, each taken out before the next
  double min_normal_share =
      0.01;                 ///< of the inliers' squared normals along any axis: below, the surfaces let the pose slide
  size_t min_inliers = 10;  ///< a pose with fewer is no candidate
  size_t enough_inliers = 40;  ///< a best candidate with as many ends the search: no further voxel size is tried
};

/// Points that can be recognised: what is computed once for each state of a map, kept, and joined to what is kept of
/// its neighbours. Columns of equal length.
struct Features {
  double voxel_size = 0;                 ///< v, metres
  std::vector<Eigen::Vector3d> points;   ///< metres, frame of the input
  std::vector<Eigen::Vector3f> normals;  ///< unit
  std::vector<Descriptor> descriptors;
};

/// The features of points, thinned to voxels of v = `voxel_size` metres. Deterministic on any number of threads.
Features FeaturesOf(const FacingPoints& input, double voxel_size, const MatcherParameters& parameters);

/// Features that can be searched: the target of any number of matches, from several threads at once.
struct MatchTarget {
  explicit MatchTarget(Features of)
      : features(std::move(of)),
        index(features.descriptors, std::make_shared<Codebook>(LearnCodebook(features.descriptors))) {}
  Features features;
  DescriptorIndex index;
};

/// A pose that some matches agree on. Not yet to be believed: refine it, then verify (design section 5).
struct PoseCandidate {
  Pose pose = Pose::Identity();  ///< T_target_source
  size_t inliers = 0;            ///< matches that agree with it
  double voxel_size = 0;         ///< metres, at which it was found
};

struct GlobalMatch {
  std::vector<PoseCandidate> candidates;  ///< most inliers first
  std::string reason;                     ///< why there is none; empty if there are candidates
};

/// The candidates of one voxel size, from features of the source at that of the target.
GlobalMatch MatchFeatures(const Features& source, const MatchTarget& target, const MatcherParameters& parameters);

/// The candidates for another place than `place` (T_target_source): no point of the source is matched within `distance`
/// metres of where it lies there, and no match need be distinctive.
GlobalMatch MatchElsewhere(const Features& source, const MatchTarget& target, const Pose& place, double distance,
                           const MatcherParameters& parameters);

/// Where the source lies in the target, without any prior: tries each target (one a voxel size, in the order to be
/// tried) until a candidate has enough inliers. That nothing is found is a result, with its reason, not an error.
/// Deterministic on any number of threads. Parallel on the calling oneTBB arena.
GlobalMatch MatchGlobally(const FacingPoints& source, std::span<const std::shared_ptr<const MatchTarget>> targets,
                          const MatcherParameters& parameters);

}  // namespace mapkeep
