#include "core/registration/session_search.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/registration/place_search.h"
#include "core/registration/placement.h"

namespace mapkeep {
namespace {

bool Disjoint(const Window& a, const Window& b) { return a.last < b.first || b.last < a.first; }

// Windows to match: those of the session; the halves of one that is too short for two that share no scan.
std::vector<Window> ProbesOf(std::span<const Window> windows) {
  const Window whole{windows.front().first, windows.back().last};
  if (Disjoint(windows.front(), windows.back())) return {windows.begin(), windows.end()};
  if (whole.first == whole.last) return {whole};
  const size_t middle = (whole.first + whole.last + 1) / 2;
  return {{whole.first, middle - 1}, {middle, whole.last}};
}

// 0, n-1 and the numbers between, so that any first few are spread evenly (van der Corput).
std::vector<size_t> SpreadOrder(size_t count) {
  std::vector<size_t> order;
  std::vector<uint8_t> taken(count);
  for (uint64_t k = 0; order.size() < count; ++k) {
    double place = 0;
    double digit = 0.5;
    for (uint64_t bits = k + 1; bits != 0; bits >>= 1, digit /= 2) place += (bits & 1) != 0 ? digit : 0;
    const auto i = std::min(static_cast<size_t>(place * static_cast<double>(count)), count - 1);
    if (std::exchange(taken[i], 1) == 0) order.push_back(i);
  }
  return order;
}

// A probe that was matched and fits.
struct Hit {
  Window window;
  Pose pose = Pose::Identity();  // T_map_window
};

bool AgreeByOdometry(const Hit& a, const Hit& b, std::span<const Pose> poses, std::span<const double> travel,
                     const AlignParameters& parameters) {
  const Pose predicted = a.pose * (poses[a.window.first].inverse() * poses[b.window.first]);
  return Agree(predicted, b.pose, TravelBetween(a.window, b.window, travel), parameters);
}

Seed SeedOf(const Hit& hit, std::span<const Pose> poses) {
  return {hit.window, hit.pose * poses[hit.window.first].inverse()};
}

// The probe to match next: the nearest that shares no scan with the last hit, on either side, else the next in order.
std::optional<size_t> NextProbe(std::span<const Window> probes, std::span<const size_t> order,
                                std::span<const uint8_t> done, std::span<const Hit> hits) {
  if (!hits.empty()) {
    const Window& last = hits.back().window;
    std::optional<size_t> nearest;
    size_t least = 0;
    for (size_t i = 0; i < probes.size(); ++i) {
      if (done[i] != 0 || !Disjoint(probes[i], last)) continue;
      const size_t apart = probes[i].first > last.last ? probes[i].first - last.last : last.first - probes[i].last;
      if (!nearest || apart < least) {
        nearest = i;
        least = apart;
      }
    }
    if (nearest) return nearest;
  }
  for (const size_t i : order) {
    if (done[i] == 0) return i;
  }
  return {};
}

std::vector<double> TravelOf(std::span<const Pose> poses) {
  std::vector<double> travel(poses.size());
  for (size_t i = 1; i < poses.size(); ++i) {
    travel[i] = travel[i - 1] + (poses[i].translation() - poses[i - 1].translation()).norm();
  }
  return travel;
}

absl::StatusOr<FoundPlace> PlaceOf(QueryBuilder& queries, const Window& window, std::span<const Pose> poses,
                                   const TargetMap& map, const std::optional<Pose>& prior,
                                   const std::optional<PositionPrior>& position, const AlignParameters& parameters) {
  const auto query = queries.QueryOf(window);
  if (!query.ok()) return query.status();
  std::optional<Eigen::AlignedBox3d> within;
  // A robot that knows the map gives poses in its frame: one more place to look at.
  std::optional<Pose> guess = poses[window.first];
  if (prior) {
    guess = *prior * poses[window.first];
    within = BoxOfWindow(window, poses, *prior, parameters.prior_reach + parameters.query_range);
  } else if (position) {
    guess.reset();
    // The heading is open: a circle about the first scan.
    double reach = ReachOf(*position) + parameters.query_range;
    for (size_t i = window.first; i <= window.last; ++i) {
      reach = std::max(reach, ReachOf(*position) + parameters.query_range +
                                  (poses[i].translation() - poses[0].translation()).norm());
    }
    const Eigen::Vector3d margin = Eigen::Vector3d::Constant(reach);
    within = Eigen::AlignedBox3d(position->position - margin, position->position + margin);
  }
  return FindPlace(*query, map, within, guess, parameters);
}

}  // namespace

Eigen::AlignedBox3d BoxOfWindow(const Window& window, std::span<const Pose> poses, const Pose& correction,
                                double reach) {
  Eigen::AlignedBox3d box;
  for (size_t i = window.first; i <= window.last; ++i) box.extend(correction * poses[i].translation());
  return {box.min() - Eigen::Vector3d::Constant(reach), box.max() + Eigen::Vector3d::Constant(reach)};
}

Pose PriorFrom(const Eigen::Vector3d& position, double yaw, const Pose& first) {
  const Eigen::Vector3d heading = first.linear().col(0);
  const double turn = yaw - std::atan2(heading.y(), heading.x());
  return Eigen::Translation3d(position) * Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()) *
         Eigen::Translation3d(-first.translation());
}

double TravelBetween(const Window& a, const Window& b, std::span<const double> travel) {
  return std::abs(travel[(b.first + b.last) / 2] - travel[(a.first + a.last) / 2]);
}

absl::StatusOr<SeedSearch> SearchMap(QueryBuilder& queries, std::span<const Pose> poses,
                                     std::span<const Window> windows, const TargetMap& map,
                                     const std::optional<Pose>& prior, const std::optional<PositionPrior>& position,
                                     const AlignParameters& parameters, const SearchProgress& progress) {
  const std::vector<Window> probes = ProbesOf(windows);
  const std::vector<size_t> order = SpreadOrder(probes.size());
  const std::vector<double> travel = TravelOf(poses);
  std::vector<uint8_t> done(probes.size());
  std::vector<Hit> hits;
  SeedSearch search;
  std::string reasons;
  for (int tried = 0; tried < parameters.max_matched_windows; ++tried) {
    const auto next = NextProbe(probes, order, done, hits);
    if (!next) break;
    done[*next] = 1;
    const Window& probe = probes[*next];
    if (!progress()) return absl::CancelledError("stopped while aligning the session");
    const auto place = PlaceOf(queries, probe, poses, map, prior, position, parameters);
    if (!place.ok()) return place.status();
    if (!place->fits) {
      absl::StrAppendFormat(&reasons, "; scans %d to %d: %s", probe.first, probe.last, place->reason);
      continue;
    }
    const Hit hit{probe, place->placement.pose};
    for (const Hit& other : hits) {
      if (!Disjoint(hit.window, other.window) || !AgreeByOdometry(other, hit, poses, travel, parameters)) continue;
      search.seed = SeedOf(hit, poses);
      return search;
    }
    hits.push_back(hit);
    // A scan alone has no second window to agree with; that nothing else fits it must do.
    if (probes.size() == 1) {
      search.seed = SeedOf(hit, poses);
      return search;
    }
  }
  // Too little of the session lies in the map for two windows: then the halves of one that has a place must agree.
  for (const Hit& whole : hits) {
    if (whole.window.first == whole.window.last) continue;
    const size_t middle = (whole.window.first + whole.window.last + 1) / 2;
    std::vector<Hit> halves;
    for (const Window& half : {Window{whole.window.first, middle - 1}, Window{middle, whole.window.last}}) {
      if (!progress()) return absl::CancelledError("stopped while aligning the session");
      const auto place = PlaceOf(queries, half, poses, map, prior, position, parameters);
      if (!place.ok()) return place.status();
      if (place->fits) halves.push_back({half, place->placement.pose});
    }
    if (halves.size() < 2 || !AgreeByOdometry(halves[0], halves[1], poses, travel, parameters) ||
        !AgreeByOdometry(halves[0], whole, poses, travel, parameters)) {
      continue;
    }
    search.seed = SeedOf(whole, poses);
    return search;
  }
  const auto tried = std::ranges::count(done, 1);
  search.reason = hits.empty()
                      ? absl::StrFormat("none of the %d windows that were matched has a place in the map", tried)
                      : absl::StrFormat(
                            "%d of the %d windows that were matched have a place in the map, but no "
                            "two agree on it",
                            hits.size(), tried);
  return SeedSearch{{}, search.reason + reasons};
}

}  // namespace mapkeep
