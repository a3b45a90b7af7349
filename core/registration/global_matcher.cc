#include "core/registration/global_matcher.h"

#include <absl/strings/str_format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <utility>

#include "core/registration/pruning.h"
#include "core/registration/solver.h"

namespace mapkeep {
namespace {

std::vector<PointPair> Chosen(std::span<const PointPair> pairs, std::span<const uint32_t> indices) {
  std::vector<PointPair> chosen;
  chosen.reserve(indices.size());
  for (const uint32_t i : indices) chosen.push_back(pairs[i]);
  return chosen;
}

bool SamePlace(const Pose& a, const Pose& b, double voxel_size) {
  return (a.translation() - b.translation()).norm() < 2 * voxel_size && AngleBetween(a, b) < 0.1;
}

void Add(PoseCandidate candidate, std::vector<PoseCandidate>& candidates) {
  for (PoseCandidate& held : candidates) {
    if (!SamePlace(held.pose, candidate.pose, std::max(held.voxel_size, candidate.voxel_size))) continue;
    if (candidate.inliers > held.inliers) held = std::move(candidate);
    return;
  }
  candidates.push_back(std::move(candidate));
}

void SortBestFirst(std::vector<PoseCandidate>& candidates) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const PoseCandidate& a, const PoseCandidate& b) { return a.inliers > b.inliers; });
}

// Whether the surfaces at the inliers face every way: along a corridor none faces the way it runs, and noise alone
// would say where on it the source lies.
bool FixesEveryDirection(const Features& source, std::span<const Match> matches, std::span<const uint32_t> inliers,
                         double min_share) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const uint32_t i : inliers) {
    const Eigen::Vector3d normal = source.normals[matches[i].source].cast<double>();
    sum += normal * normal.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(sum, Eigen::EigenvaluesOnly);
  return axes.eigenvalues()[0] > min_share * static_cast<double>(inliers.size());
}

}  // namespace

Features FeaturesOf(const FacingPoints& input, double voxel_size, const MatcherParameters& parameters) {
  const MatchCloud cloud = MakeMatchCloud(input, voxel_size, parameters.normal_radius);
  const std::vector<Descriptor> descriptors = DescribePoints(cloud, parameters.descriptor_radius);
  Features features{.voxel_size = voxel_size};
  for (size_t i = 0; i < descriptors.size(); ++i) {
    if (FlatnessOf(descriptors[i]) > parameters.max_flatness) continue;
    features.points.push_back(cloud.points[i]);
    features.normals.push_back(cloud.normals[i]);
    features.descriptors.push_back(descriptors[i]);
  }
  return features;
}

namespace {

// From matches to poses.
GlobalMatch PosesFrom(std::span<const Match> matches, const Features& source, const MatchTarget& target,
                      const MatcherParameters& parameters) {
  std::vector<PointPair> pairs;
  pairs.reserve(matches.size());
  for (const Match& match : matches) {
    pairs.push_back({source.points[match.source], target.features.points[match.target]});
  }
  const double voxel = source.voxel_size;
  const CompatibilityGraph graph(pairs, parameters.graph_bound * voxel);
  std::vector<uint8_t> alive(pairs.size(), 1);
  GlobalMatch result;
  size_t largest = 0;
  for (int core = 0; core < parameters.max_cores; ++core) {
    const auto members = LargestCore(graph, alive);
    if (members.size() < parameters.min_inliers) break;
    largest = std::max(largest, members.size());
    // A core can be large and wrong; what it leaves behind may then hold the right one.
    for (const uint32_t i : members) alive[i] = 0;
    auto estimate = SolvePose(Chosen(pairs, members), parameters.solver_bound * voxel, parameters.gnc_factor);
    if (estimate) estimate = RefitPose(pairs, estimate->pose, parameters.inlier_bound * voxel);
    if (!estimate || estimate->inliers.size() < parameters.min_inliers) continue;
    for (const uint32_t i : estimate->inliers) alive[i] = 0;
    if (!FixesEveryDirection(source, matches, estimate->inliers, parameters.min_normal_share)) continue;
    Add({estimate->pose, estimate->inliers.size(), voxel}, result.candidates);
  }
  SortBestFirst(result.candidates);
  if (result.candidates.empty()) {
    result.reason = absl::StrFormat(
        "at a voxel of %g m: %d features, %d matches, the largest core has %d, no pose with %d inliers that face every "
        "way",
        voxel, source.points.size(), matches.size(), largest, parameters.min_inliers);
  }
  return result;
}

}  // namespace

GlobalMatch MatchFeatures(const Features& source, const MatchTarget& target, const MatcherParameters& parameters) {
  const auto matches =
      MatchDescriptors(source.descriptors, target.features.descriptors, target.index, parameters.matching);
  return PosesFrom(matches, source, target, parameters);
}

GlobalMatch MatchElsewhere(const Features& source, const MatchTarget& target, const Pose& place, double distance,
                           const MatcherParameters& parameters) {
  std::vector<Eigen::Vector3d> placed;
  placed.reserve(source.points.size());
  for (const Eigen::Vector3d& point : source.points) placed.push_back(place * point);
  const AdmitMatch elsewhere = [&](uint32_t from, uint32_t to) {
    return (placed[from] - target.features.points[to]).squaredNorm() > distance * distance;
  };
  MatchingParameters matching = parameters.matching;
  matching.max_ratio = 1;
  const auto matches =
      MatchDescriptors(source.descriptors, target.features.descriptors, target.index, matching, elsewhere);
  return PosesFrom(matches, source, target, parameters);
}

GlobalMatch MatchGlobally(const FacingPoints& source, std::span<const std::shared_ptr<const MatchTarget>> targets,
                          const MatcherParameters& parameters) {
  GlobalMatch all;
  for (const auto& target : targets) {
    const Features features = FeaturesOf(source, target->features.voxel_size, parameters);
    GlobalMatch found = MatchFeatures(features, *target, parameters);
    for (PoseCandidate& candidate : found.candidates) Add(std::move(candidate), all.candidates);
    if (!found.reason.empty()) all.reason += (all.reason.empty() ? "" : "; ") + found.reason;
    SortBestFirst(all.candidates);
    if (!all.candidates.empty() && all.candidates.front().inliers >= parameters.enough_inliers) break;
  }
  if (!all.candidates.empty()) all.reason.clear();
  if (all.candidates.empty() && all.reason.empty()) all.reason = "there is no target to match against";
  return all;
}

}  // namespace mapkeep
