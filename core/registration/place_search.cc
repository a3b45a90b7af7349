#include "core/registration/place_search.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "core/registration/thinning.h"

namespace mapkeep {
namespace {

constexpr size_t kMaxCandidates = 4;   // of a match, that are refined
constexpr double kTargetMargin = 3;    // metres about a candidate from which the map is read
constexpr double kSameDistance = 2;    // metres; candidates that refine to within this are one place
constexpr double kSameAngle = 0.1;     // radians
constexpr double kElsewhere = 3;       // metres from where a point lies, from which on a match is another place
constexpr double kScreenThinning = 2;  // source voxels: what candidates are refined with

bool SamePlace(const Pose& a, const Pose& b) {
  return (a.translation() - b.translation()).norm() < kSameDistance && AngleBetween(a, b) < kSameAngle;
}

// The candidates refined, each place once, best surface first.
absl::StatusOr<std::vector<std::pair<Placement, size_t>>> Refined(std::span<const PoseCandidate> candidates,
                                                                  std::span<const Eigen::Vector3d> query,
                                                                  const TargetMap& map,
                                                                  const AlignParameters& parameters) {
  std::vector<std::pair<Placement, size_t>> places;
  for (const PoseCandidate& candidate : candidates.first(std::min(candidates.size(), kMaxCandidates))) {
    const Eigen::AlignedBox3d box = BoxAbout(query, candidate.pose, kTargetMargin);
    auto target = map.points(std::span(&box, 1));
    if (!target.ok()) return target.status();
    const Placer placer(*std::move(target), parameters);
    Placement placement = placer.Place(query, candidate.pose);
    if (std::ranges::any_of(places, [&](const auto& held) { return SamePlace(held.first.pose, placement.pose); })) {
      continue;
    }
    places.emplace_back(std::move(placement), candidate.inliers);
  }
  std::ranges::stable_sort(places, std::greater<>{}, [](const auto& place) { return place.first.fit.surface_share; });
  return places;
}

// Candidates for another place than `place`.
std::vector<PoseCandidate> Elsewhere(const FacingPoints& query,
                                     std::span<const std::shared_ptr<const MatchTarget>> targets, const Pose& place,
                                     const MatcherParameters& parameters) {
  std::vector<PoseCandidate> candidates;
  for (const auto& target : targets) {
    const Features features = FeaturesOf(query, target->features.voxel_size, parameters);
    GlobalMatch match = MatchElsewhere(features, *target, place, kElsewhere, parameters);
    if (match.candidates.size() > 1) match.candidates.resize(1);
    std::ranges::move(match.candidates, std::back_inserter(candidates));
  }
  return candidates;
}

std::string WhyNot(const Fit& fit, double rival, const AlignParameters& parameters) {
  if (!FitsMapWithoutPrior(fit, parameters)) {
    return absl::StrFormat(
        "its best place has fitness %.2f (at least %.2f is needed without a prior), precision %.2f (%.2f), coverage "
        "%.2f (%.2f), %d inliers (%d), observability %.3f (%.3f)",
        fit.fitness, std::max(parameters.first_fitness, parameters.min_fitness), fit.precision,
        std::max(parameters.first_precision, parameters.min_precision), fit.coverage,
        std::max(parameters.first_coverage, parameters.min_coverage), fit.inliers, parameters.min_inliers,
        fit.observability, parameters.min_observability);
  }
  if (rival >= parameters.alias_share * fit.surface_share) {
    return absl::StrFormat("two places fit it: %.2f and %.2f of its points are on surfaces there", fit.surface_share,
                           rival);
  }
  return {};
}

}  // namespace

Eigen::AlignedBox3d BoxAbout(std::span<const Eigen::Vector3d> points, const Pose& pose, double margin) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point : points) box.extend(pose * point);
  return {box.min() - Eigen::Vector3d::Constant(margin), box.max() + Eigen::Vector3d::Constant(margin)};
}

absl::StatusOr<FoundPlace> FindPlace(const FacingPoints& query, const TargetMap& map,
                                     const std::optional<Eigen::AlignedBox3d>& within,
                                     const AlignParameters& parameters) {
  FoundPlace found;
  const auto targets = map.match_targets(query, within);
  if (!targets.ok()) return targets.status();
  const GlobalMatch match = MatchGlobally(query, *targets, parameters.matcher);
  if (match.candidates.empty()) {
    found.reason = match.reason;
    return found;
  }
  const std::vector<Eigen::Vector3d> thinned = ThinPoints(query.points, kScreenThinning * parameters.source_voxel);
  auto places = Refined(match.candidates, thinned, map, parameters);
  if (!places.ok()) return places.status();
  found.placement = places->front().first;
  found.matches = places->front().second;
  if (places->size() > 1) found.rival = (*places)[1].first.fit.surface_share;
  found.reason = WhyNot(found.placement.fit, found.rival, parameters);
  if (!found.reason.empty()) return found;

  const auto others = Elsewhere(query, *targets, found.placement.pose, parameters.matcher);
  auto rivals = Refined(others, thinned, map, parameters);
  if (!rivals.ok()) return rivals.status();
  for (const auto& [placement, matches] : *rivals) {
    if (SamePlace(placement.pose, found.placement.pose)) continue;
    found.rival = std::max(found.rival, placement.fit.surface_share);
  }
  found.reason = WhyNot(found.placement.fit, found.rival, parameters);
  found.fits = found.reason.empty();
  return found;
}

}  // namespace mapkeep
