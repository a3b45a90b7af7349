#include "core/registration/aligner.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "core/registration/fusion.h"
#include "core/registration/place_search.h"
#include "core/registration/placement.h"
#include "core/registration/plan_search.h"
#include "core/registration/pose_graph.h"
#include "core/registration/query.h"
#include "core/registration/session_search.h"
#include "core/registration/window_cloud.h"
#include "core/registration/windows.h"

namespace mapkeep {
namespace {

constexpr double kTargetMargin = 2;  // metres about a session's reach from which the map is read, beyond max_correction

absl::Status CheckInput(const ScanSource& scans, std::span<const Pose> poses, const AlignParameters& parameters) {
  for (const auto& [name, value] :
       {std::pair("source_voxel", parameters.source_voxel), std::pair("query_range", parameters.query_range),
        std::pair("coarse_correspondence", parameters.coarse_correspondence),
        std::pair("fine_correspondence", parameters.fine_correspondence),
        std::pair("inlier_distance", parameters.inlier_distance),
        std::pair("coarse_robust_width", parameters.coarse_robust_width),
        std::pair("fine_robust_width", parameters.fine_robust_width)}) {
    if (!(value > 0))
      return absl::InvalidArgumentError(absl::StrFormat("%s is %g m, expected more than 0", name, value));
  }
  if (scans.count != poses.size()) {
    return absl::InvalidArgumentError(absl::StrFormat("%d scans but %d poses", scans.count, poses.size()));
  }
  return absl::OkStatus();
}

/// What is known of one window while the session is tracked.
struct TrackedWindow {
  Window window;
  WindowResult result;
  Placement placement;
  Pose correction = Pose::Identity();  // T_abs^u; of a window that is not trusted: what it was tried with
};

// The window that has those scans nearest to its middle.
size_t WindowAt(std::span<const TrackedWindow> windows, const Window& seed) {
  const auto middle = static_cast<double>(seed.first + seed.last);
  const auto nearest = std::ranges::min_element(windows, {}, [&](const TrackedWindow& w) {
    return std::abs(static_cast<double>(w.window.first + w.window.last) - middle);
  });
  return static_cast<size_t>(nearest - windows.begin());
}

/// One session on its way.
class Tracker {
 public:
  Tracker(QueryBuilder& queries, std::span<const Pose> poses, const TargetMap& map, const AlignParameters& parameters,
          std::function<bool()> progress)
      : queries_(queries), poses_(poses), map_(map), parameters_(parameters), progress_(std::move(progress)) {
    for (const Window& window : WindowsOf(poses, parameters)) windows_.push_back({.window = window});
    for (size_t i = 1; i < poses.size(); ++i) {
      travel_.push_back(travel_.back() + (poses[i].translation() - poses[i - 1].translation()).norm());
    }
    for (size_t i = 0; i < poses.size(); ++i) owners_.push_back(WindowAt(windows_, {i, i}));
  }

  std::vector<TrackedWindow>& windows() { return windows_; }
  /// Where each scan lies by its own points, if a trusted window has it in its middle.
  const std::vector<ScanPlacement>& scans() const { return scans_; }
  /// Metres of travel of the session.
  double travel() const { return travel_.back(); }
  /// The map has nothing where the session was tracked.
  bool nothing_near() const { return nothing_near_; }

  /// Tracks forwards from window `first` and backwards from the first one that is trusted, starting from `prior`. Up to
  /// that one, windows may move as far from the prior as from a guess of a person; then as far as odometry may err.
  absl::Status TrackFrom(size_t first, const Pose& prior) {
    auto target = TargetUnder(prior);
    if (!target.ok()) return target.status();
    const Placer placer(*std::move(target), parameters_);
    nothing_near_ = placer.empty();
    scans_.assign(poses_.size(), {});
    local_plan_ = placer.PlanOfTarget();
    if (nothing_near_) return absl::OkStatus();
    std::optional<size_t> last;
    std::optional<size_t> seed;
    for (size_t u = first; u < windows_.size(); ++u) {
      const absl::Status status = Follow(placer, u, last, last ? windows_[*last].correction : prior);
      if (!status.ok()) return status;
      if (windows_[u].result.trusted) {
        if (!seed) seed = u;
        last = u;
      }
    }
    last = seed;
    for (size_t u = seed.value_or(first); u-- > 0;) {
      const absl::Status status = Follow(placer, u, last, last ? windows_[*last].correction : prior);
      if (!status.ok()) return status;
      if (windows_[u].result.trusted) last = u;
    }
    return absl::OkStatus();
  }

  /// Whether the first trusted window fits another place within `prior_reach` of where it was tracked clearly better:
  /// the prior was wrong, in a street that looks alike.
  absl::StatusOr<bool> FitsBetterNearby() {
    const auto seed = std::ranges::find_if(windows_, [](const TrackedWindow& w) { return w.result.trusted; });
    if (seed == windows_.end()) return false;
    const auto query = queries_.QueryOf(seed->window);
    if (!query.ok()) return query.status();
    const Eigen::AlignedBox3d box =
        BoxOfWindow(seed->window, poses_, seed->correction, parameters_.query_range + parameters_.prior_reach);
    auto target = map_.points(std::span(&box, 1));
    if (!target.ok()) return target.status();
    const TargetMap near = MapOf(*std::move(target), parameters_.matcher);
    const auto plan = near.plan();
    if (!plan.ok()) return plan.status();
    // Mostly nothing else looks like it from above, and the rest is saved.
    const Pose& tracked = seed->placement.pose;
    const auto is_here = [&](const PlanPlace& place) { return SamePlace(place.pose, tracked); };
    const auto places = SearchPlan(PlanQueryOf(*query, parameters_.plan), **plan, {}, parameters_.plan);
    const auto here = std::ranges::find_if(places, is_here);
    if (here != places.end() && std::ranges::all_of(places, [&](const PlanPlace& place) {
          return is_here(place) || place.walls < parameters_.plan_rival * here->walls;
        })) {
      return false;
    }
    const auto place = FindPlace(*query, near, {}, tracked, parameters_);
    if (!place.ok()) return place.status();
    return place->fits && !SamePlace(place->placement.pose, tracked);
  }

 private:
  absl::StatusOr<RegistrationTarget> TargetUnder(const Pose& correction) const {
    std::vector<Eigen::AlignedBox3d> boxes;
    const double reach = parameters_.query_range + parameters_.max_correction + kTargetMargin;
    for (const TrackedWindow& window : windows_) {
      boxes.push_back(BoxOfWindow(window.window, poses_, correction, reach));
    }
    return map_.points(boxes);
  }

  // Places window u from a correction: that of the trusted window `from`, if there is one.
  absl::Status Follow(const Placer& placer, size_t u, const std::optional<size_t>& from, const Pose& correction) {
    if (progress_ && !progress_()) return absl::CancelledError("stopped while aligning the session");
    TrackedWindow& tracked = windows_[u];
    const auto query = queries_.QueryOf(tracked.window);
    if (!query.ok()) return query.status();
    const Pose& first = poses_[tracked.window.first];
    const Pose guess = correction * first;
    const WindowCloud cloud(query->points, parameters_.source_voxel);
    const auto follows = [&](const Placement& placed) {
      return FitsMap(placed.fit, parameters_) && placed.correction <= parameters_.max_correction &&
             placed.rotation <= parameters_.max_rotation;
    };
    // Odometry from a trusted window leaves centimetres to find; where that does not do, as from any guess.
    Placement placement = from ? placer.Follow(cloud, guess) : placer.Place(cloud, guess);
    if (from && !follows(placement) && placement.fit.coverage >= parameters_.min_coverage) {
      placement = placer.Place(cloud, guess);
    }
    const double travel = from ? TravelBetween(windows_[*from].window, tracked.window, travel_) : 0;
    bool trusted =
        follows(placement) &&
        (from ? Agree(guess, placement.pose, travel, parameters_)
              : StructureFits(placer.Structure(PlanQueryOf(*query, parameters_.plan), local_plan_, placement.pose),
                              parameters_));
    const size_t lost = from ? (u > *from ? u - *from : *from - u) : 0;
    if (!trusted && lost >= static_cast<size_t>(parameters_.lost_windows) &&
        placement.fit.coverage >= parameters_.min_coverage) {
      const Eigen::AlignedBox3d near =
          BoxOfWindow(tracked.window, poses_, correction, parameters_.query_range + parameters_.prior_reach);
      const auto place = FindPlace(*query, map_, near, {}, parameters_);
      if (!place.ok()) return place.status();
      if (place->fits && Agree(guess, place->placement.pose, travel, parameters_)) {
        placement = placer.Place(cloud, place->placement.pose);
        trusted = FitsMap(placement.fit, parameters_);
      }
    }
    tracked.result = {.first_scan = static_cast<uint32_t>(tracked.window.first),
                      .last_scan = static_cast<uint32_t>(tracked.window.last),
                      .fitness = placement.fit.fitness,
                      .inliers = static_cast<uint32_t>(placement.fit.inliers),
                      .correction = (placement.pose.translation() - guess.translation()).norm(),
                      .rotation = AngleBetween(placement.pose, guess),
                      .observability = placement.fit.observability,
                      .trusted = trusted,
                      .precision = placement.fit.precision,
                      .coverage = placement.fit.coverage};
    tracked.correction = trusted ? placement.pose * first.inverse() : correction;
    tracked.placement = placement;
    if (trusted && parameters_.scan_poses == ScanPoses::kPoseGraph) PlaceScans(placer, u, cloud);
    return absl::OkStatus();
  }

  // The scans that lie nearest to the middle of window u.
  void PlaceScans(const Placer& placer, size_t u, const WindowCloud& cloud) {
    const TrackedWindow& tracked = windows_[u];
    std::vector<size_t> own;
    std::vector<const std::vector<Eigen::Vector3f>*> points;
    std::vector<Pose> sensors;
    for (size_t i = tracked.window.first; i <= tracked.window.last; ++i) {
      if (owners_[i] != u) continue;
      own.push_back(i);
      points.push_back(&queries_.PointsOf(i));
      sensors.push_back(poses_[tracked.window.first].inverse() * poses_[i]);
    }
    std::vector<ScanPlacement> placed = placer.PlaceScans(cloud, points, sensors, tracked.placement.pose);
    for (size_t k = 0; k < own.size(); ++k) scans_[own[k]] = placed[k];
  }

  QueryBuilder& queries_;
  std::span<const Pose> poses_;
  const TargetMap& map_;
  const AlignParameters& parameters_;
  std::function<bool()> progress_;
  std::vector<TrackedWindow> windows_;
  std::vector<double> travel_{0.0};
  std::vector<size_t> owners_;  // of each scan, the window with it nearest to the middle
  std::vector<ScanPlacement> scans_;
  WallPlan local_plan_{{}};
  bool nothing_near_ = false;
};

size_t TrustedCount(std::span<const TrackedWindow> windows) {
  return static_cast<size_t>(std::ranges::count_if(windows, [](const auto& w) { return w.result.trusted; }));
}

std::string NothingFits(std::span<const TrackedWindow> windows, const AlignParameters& parameters) {
  const auto best = std::ranges::max_element(windows, {}, [](const TrackedWindow& w) { return w.result.fitness; });
  const WindowResult& result = best->result;
  return absl::StrFormat(
      "no window of %d fits the map; the best, scans %d to %d, has fitness %.2f (at least %.2f is needed), %d inliers "
      "(%d), precision %.2f (%.2f), coverage %.2f (%.2f), moved %.2f m (at most %.2f) and %.3f rad (%.3f), "
      "observability %.3f (at least %.3f)",
      windows.size(), result.first_scan, result.last_scan, result.fitness, parameters.min_fitness, result.inliers,
      parameters.min_inliers, result.precision, parameters.min_precision, result.coverage, parameters.min_coverage,
      result.correction, parameters.max_correction, result.rotation, parameters.max_rotation, result.observability,
      parameters.min_observability);
}

// Decides on a tracked session and makes its scan poses.
void Conclude(std::span<const Pose> poses, std::span<const TrackedWindow> windows, std::span<const ScanPlacement> scans,
              const AlignParameters& parameters, Alignment& alignment) {
  std::vector<TrustedWindow> trusted;
  size_t inside = 0;
  for (const TrackedWindow& window : windows) {
    alignment.windows.push_back(window.result);
    if (window.result.trusted || window.result.coverage >= parameters.min_coverage) ++inside;
    if (!window.result.trusted) continue;
    trusted.push_back({window.window, window.correction, window.result.fitness, window.placement.centre,
                       window.placement.information});
  }
  alignment.lacks_map = 2 * inside < windows.size();
  if (trusted.empty()) {
    alignment.reason = NothingFits(windows, parameters);
    return;
  }
  if (static_cast<double>(trusted.size()) < parameters.min_trusted_share * static_cast<double>(inside)) {
    alignment.reason = absl::StrFormat("only %d of the %d windows inside the map fit it (a share of %.2f is needed)",
                                       trusted.size(), inside, parameters.min_trusted_share);
    return;
  }
  alignment.accepted = true;
  alignment.lacks_map = false;
  alignment.verdict = inside < windows.size() ? Verdict::kExtends : Verdict::kAligned;
  alignment.poses =
      parameters.scan_poses == ScanPoses::kFusion ? FusePoses(poses, trusted) : OptimisePoses(poses, trusted, scans);
}

// Refuses what lies elsewhere than its position says. `travel`: metres of the whole session, by which its first scan
// may have drifted from the trusted windows.
void CheckPosition(const PositionPrior& position, double travel, const AlignParameters& parameters,
                   Alignment& alignment) {
  if (!alignment.accepted) return;
  const Eigen::Vector3d place = alignment.poses.front().translation();
  const double off = DeviationsFrom(position, place, parameters.agree_distance + parameters.agree_per_metre * travel);
  if (off <= kMostDeviations) return;
  alignment = Alignment{
      .reason = absl::StrFormat("it fits the map, but its first scan then lies %.1f m from where GNSS has it: %.1f "
                                "deviations, at most %.0f are allowed",
                                (place - position.position).norm(), off, kMostDeviations),
      .windows = std::move(alignment.windows)};
}

}  // namespace

absl::StatusOr<Alignment> AlignSession(const ScanSource& scans, std::span<const Pose> poses, const TargetMap& map,
                                       const std::optional<Pose>& prior, const AlignParameters& parameters,
                                       const Progress& progress, const std::optional<PositionPrior>& position) {
  if (const absl::Status status = CheckInput(scans, poses, parameters); !status.ok()) return status;
  Alignment alignment;
  if (poses.empty()) {
    alignment.reason = "the session has no scans";
    return alignment;
  }
  QueryBuilder queries(scans, poses, parameters.source_voxel, parameters.query_range);
  const std::vector<Window> windows = WindowsOf(poses, parameters);
  // A window may be visited twice; how often is known only at the end.
  size_t steps = 0;
  const auto step = [&] {
    ++steps;
    const auto expected = static_cast<double>(windows.size()) + parameters.max_matched_windows + 5;
    return !progress || progress(std::min(1.0, static_cast<double>(steps) / expected));
  };
  Tracker tracker(queries, poses, map, parameters, step);
  if (prior) {
    if (const absl::Status status = tracker.TrackFrom(0, *prior); !status.ok()) return status;
  }
  bool wrong_prior = false;
  if (prior) {
    const auto better = tracker.FitsBetterNearby();
    if (!better.ok()) return better.status();
    wrong_prior = *better;
  }
  if (wrong_prior || TrustedCount(tracker.windows()) == 0) {
    const auto search = SearchMap(queries, poses, windows, map, prior, position, parameters, step);
    if (!search.ok()) return search.status();
    if (search->seed) {
      const size_t first = WindowAt(tracker.windows(), search->seed->window);
      const absl::Status status = tracker.TrackFrom(first, search->seed->correction);
      if (!status.ok()) return status;
    } else {
      for (const TrackedWindow& window : tracker.windows()) {
        WindowResult result = window.result;
        result.first_scan = static_cast<uint32_t>(window.window.first);
        result.last_scan = static_cast<uint32_t>(window.window.last);
        alignment.windows.push_back(result);
      }
      alignment.reason = search->reason;
      alignment.lacks_map = !prior;  // it may lie where the map does not reach yet
      if (prior) {
        alignment.lacks_map = tracker.nothing_near();
        alignment.reason =
            (wrong_prior ? std::string("another place near the initial pose fits better than where that puts it")
             : tracker.nothing_near() ? std::string("the map has nothing static near the session")
                                      : NothingFits(tracker.windows(), parameters)) +
            "; " + alignment.reason;
      }
      return alignment;
    }
  }
  Conclude(poses, tracker.windows(), tracker.scans(), parameters, alignment);
  if (position) CheckPosition(*position, tracker.travel(), parameters, alignment);
  if (progress && !progress(1)) return absl::CancelledError("stopped while aligning the session");
  return alignment;
}

}  // namespace mapkeep
