#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/geometry/pose.h"
#include "core/registration/pruning.h"

namespace mapkeep {

/// The rotation R that makes R * source close to target for most of the difference vectors: truncated least squares by
/// graduated non-convexity (Yang et al., 2020), the non-convexity growing by `factor` a step. `bound` is the largest
/// residual of an inlier, metres. Nothing if the vectors do not span a plane, or none survives.
std::optional<Eigen::Matrix3d> SolveRotation(std::span<const PointPair> differences, double bound, double factor);

/// The value that minimises the sum of min((x - v)^2, bound^2) over the values v: exact, by sweeping the ends of the
/// intervals v +- bound (Yang et al., TEASER, 2020). There must be at least one value.
double TruncatedMean(std::span<const double> values, double bound);

/// A rigid motion and the pairs that agree with it.
struct PoseEstimate {
  Pose pose = Pose::Identity();   ///< T_target_source
  std::vector<uint32_t> inliers;  ///< ascending
};

/// The motion that most pairs agree on: rotation from the differences between pairs, translation axis by axis, then
/// least squares over the pairs within `bound` metres, until these stay the same. Nothing if fewer than three agree, or
/// if they lie so close to one line (within `bound`) that the turn about it is open.
std::optional<PoseEstimate> SolvePose(std::span<const PointPair> pairs, double bound, double factor);

/// Least squares over the pairs within `bound` of `guess`, repeated until they stay the same (at most ten times).
/// Nothing as in SolvePose.
std::optional<PoseEstimate> RefitPose(std::span<const PointPair> pairs, const Pose& guess, double bound);

}  // namespace mapkeep
