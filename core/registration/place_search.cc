#include "core/registration/place_search.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <functional>
#include <utility>
#include <vector>

#include "core/registration/plan_search.h"
#include "core/registration/window_cloud.h"

namespace mapkeep {
namespace {

constexpr size_t kMaxCandidates = 6;  // from above, that are refined
constexpr size_t kMaxMatched = 4;     // by descriptors, likewise
constexpr double kMatchedAlias =
    0.85;  // of a place's surface share, by descriptors: a rival that has it makes it ambiguous
constexpr double kTargetMargin = 3;  // metres about a candidate from which the map is read
constexpr double kSameDistance = 2;  // metres; candidates that refine to within this are one place
constexpr double kSameAngle = 0.1;   // radians
constexpr double kElsewhere = 3;     // metres from where a point lies, from which on a match is another place

// A candidate, refined.
struct RefinedPlace {
  Placement placement;
  size_t matches = 0;
  double score = 0;  // what places are compared by
  StructureFit structure;
};

// A candidate's score where refinement put it, by the Placer that did.
using Scorer = std::function<void(const Placer&, RefinedPlace&)>;

void ScoreBySurface(const Placer&, RefinedPlace& place) { place.score = place.placement.fit.surface_share; }

// The candidates refined, each place once, best score first.
absl::StatusOr<std::vector<RefinedPlace>> Refined(std::span<const PoseCandidate> candidates, const WindowCloud& window,
                                                  const TargetMap& map, const AlignParameters& parameters,
                                                  const Scorer& score) {
  std::vector<absl::Status> read(candidates.size());
  std::vector<RefinedPlace> refined(candidates.size());
  // Most of a candidate's time is its search tree, which is built by one thread.
  tbb::parallel_for(size_t{0}, candidates.size(), [&](size_t i) {
    const Eigen::AlignedBox3d box = BoxAbout(window.fine().points, candidates[i].pose, kTargetMargin);
    auto target = map.points(std::span(&box, 1));
    read[i] = target.status();
    if (!target.ok()) return;
    const Placer placer(*std::move(target), parameters);
    refined[i] = {.placement = placer.Place(window, candidates[i].pose), .matches = candidates[i].inliers};
    score(placer, refined[i]);
  });
  std::vector<RefinedPlace> places;
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (!read[i].ok()) return read[i];
    const bool held = std::ranges::any_of(
        places, [&](const RefinedPlace& place) { return SamePlace(place.placement.pose, refined[i].placement.pose); });
    if (!held) places.push_back(std::move(refined[i]));
  }
  std::ranges::stable_sort(places, std::greater<>{}, &RefinedPlace::score);
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

std::string NumbersOf(const Fit& fit, double fitness, double precision, double coverage,
                      const AlignParameters& parameters) {
  return absl::StrFormat(
      "its best place has fitness %.2f (at least %.2f is needed), precision %.2f (%.2f), coverage %.2f (%.2f), %d "
      "inliers (%d), observability %.3f (%.3f)",
      fit.fitness, fitness, fit.precision, precision, fit.coverage, coverage, fit.inliers, parameters.min_inliers,
      fit.observability, parameters.min_observability);
}

std::string TwoFit(double best, double rival, const char* what) {
  return absl::StrFormat("two places fit it: %.2f and %.2f %s", best, rival, what);
}

}  // namespace

bool SamePlace(const Pose& a, const Pose& b) {
  return (a.translation() - b.translation()).norm() < kSameDistance && AngleBetween(a, b) < kSameAngle;
}

Eigen::AlignedBox3d BoxAbout(std::span<const Eigen::Vector3d> points, const Pose& pose, double margin) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point : points) box.extend(pose * point);
  return {box.min() - Eigen::Vector3d::Constant(margin), box.max() + Eigen::Vector3d::Constant(margin)};
}

namespace {

// From above: the places that look most like the query. All headings and every place were looked at, so that a rival
// is among them.
absl::StatusOr<FoundPlace> FindFromAbove(const FacingPoints& query, const WindowCloud& window, const TargetMap& map,
                                         const std::optional<Eigen::AlignedBox3d>& within,
                                         const std::optional<Pose>& guess, const AlignParameters& parameters) {
  const auto plan = map.plan();
  if (!plan.ok()) return plan.status();
  const PlanQuery above = PlanQueryOf(query, parameters.plan);
  const std::vector<PlanPlace> places = SearchPlan(above, **plan, within, parameters.plan);
  std::vector<PoseCandidate> candidates;
  for (const PlanPlace& place : places) {
    if (place.walls < parameters.plan_rival * places.front().walls || candidates.size() == kMaxCandidates) break;
    candidates.push_back({.pose = place.pose,
                          .inliers = static_cast<size_t>(place.walls * static_cast<double>(above.walls.size())),
                          .voxel_size = kPlanCell});
  }
  if (guess && !above.walls.empty()) candidates.push_back({.pose = *guess, .inliers = 1, .voxel_size = kPlanCell});
  if (candidates.empty()) {
    return FoundPlace{.reason = absl::StrFormat("from above: %d walls, %d floors, no place in the map",
                                                above.walls.size(), above.floors.size())};
  }
  const auto refined = Refined(candidates, window, map, parameters, [&](const Placer& placer, RefinedPlace& place) {
    place.structure = placer.Structure(above, **plan, place.placement.pose);
    place.score = place.structure.score();
  });
  if (!refined.ok()) return refined.status();
  const RefinedPlace& best = refined->front();
  FoundPlace found{.placement = best.placement, .matches = best.matches, .structure = best.structure};
  if (refined->size() > 1) found.rival = (*refined)[1].score;
  if (!FitsMap(best.placement.fit, parameters)) {
    found.reason = NumbersOf(best.placement.fit, parameters.min_fitness, parameters.min_precision,
                             parameters.min_coverage, parameters);
  } else if (!StructureFits(best.structure, parameters)) {
    found.reason = absl::StrFormat("what stands upright fits its best place by %.3f (at least %.3f is needed)",
                                   best.score, parameters.first_structure);
  } else if (found.rival >= parameters.alias_share * best.score) {
    found.reason = TwoFit(best.score, found.rival, "of what stands upright");
  }
  found.fits = found.reason.empty();
  return found;
}

// By descriptors: any tilt, any ground.
absl::StatusOr<FoundPlace> FindByDescriptors(const FacingPoints& query, const WindowCloud& window, const TargetMap& map,
                                             const std::optional<Eigen::AlignedBox3d>& within,
                                             const AlignParameters& parameters) {
  // To describe a map takes long: not for what nobody could recognise.
  const size_t features = FeaturesOf(query, kMatchVoxels[0], parameters.matcher).points.size();
  if (features < parameters.matcher.min_inliers) {
    return FoundPlace{.reason = absl::StrFormat("by descriptors: %d features, at least %d are needed", features,
                                                parameters.matcher.min_inliers)};
  }
  const auto targets = map.match_targets(query, within);
  if (!targets.ok()) return targets.status();
  const GlobalMatch match = MatchGlobally(query, *targets, parameters.matcher);
  if (match.candidates.empty()) return FoundPlace{.reason = match.reason};
  const std::span<const PoseCandidate> candidates(match.candidates);
  const auto places =
      Refined(candidates.first(std::min(candidates.size(), kMaxMatched)), window, map, parameters, ScoreBySurface);
  if (!places.ok()) return places.status();
  const RefinedPlace& best = places->front();
  FoundPlace found{.placement = best.placement, .matches = best.matches};
  if (places->size() > 1) found.rival = (*places)[1].score;
  if (!FitsMapWithoutPrior(best.placement.fit, parameters)) {
    found.reason = NumbersOf(best.placement.fit, std::max(parameters.first_fitness, parameters.min_fitness),
                             std::max(parameters.first_precision, parameters.min_precision),
                             std::max(parameters.first_coverage, parameters.min_coverage), parameters);
    return found;
  }
  const auto others = Elsewhere(query, *targets, found.placement.pose, parameters.matcher);
  const auto rivals = Refined(others, window, map, parameters, ScoreBySurface);
  if (!rivals.ok()) return rivals.status();
  for (const RefinedPlace& rival : *rivals) {
    if (!SamePlace(rival.placement.pose, best.placement.pose)) found.rival = std::max(found.rival, rival.score);
  }
  if (found.rival >= kMatchedAlias * best.score) {
    found.reason = TwoFit(best.score, found.rival, "of its points are on surfaces there");
  }
  found.fits = found.reason.empty();
  return found;
}

}  // namespace

absl::StatusOr<FoundPlace> FindPlace(const FacingPoints& query, const TargetMap& map,
                                     const std::optional<Eigen::AlignedBox3d>& within, const std::optional<Pose>& guess,
                                     const AlignParameters& parameters) {
  const WindowCloud window(query.points, parameters.source_voxel);
  auto from_above = FindFromAbove(query, window, map, within, guess, parameters);
  // Descriptors only where there is no place at all from above: a frame that lies on its side, no floor. That what was
  // found does not fit, or has a rival, is an answer that a second look at a part of the map must not turn round.
  if (!from_above.ok() || from_above->matches > 0 || !parameters.match_descriptors) return from_above;
  auto found = FindByDescriptors(query, window, map, within, parameters);
  if (found.ok() && found->matches == 0) found->reason = absl::StrCat(from_above->reason, "; ", found->reason);
  return found;
}

}  // namespace mapkeep
