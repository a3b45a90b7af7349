#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/geometry/pose.h"
#include "core/registration/parameters.h"
#include "core/registration/position_prior.h"
#include "core/registration/query.h"
#include "core/registration/target_map.h"
#include "core/registration/windows.h"

namespace mapkeep {

/// A window from which a session can be tracked.
struct Seed {
  Window window;
  Pose correction = Pose::Identity();  ///< T_map_session, exact at the window
};

/// The outcome of a search: a seed, or why there is none.
struct SeedSearch {
  std::optional<Seed> seed;
  std::string reason;
};

/// Told before each window of a search; returns false to stop it, which makes the search return CANCELLED.
using SearchProgress = std::function<bool()>;

/// Looks for the session all over the map, or within `prior_reach` of where `prior` (T_map_session) puts it, or as far
/// about the `position` of its first scan as that may be wrong and the session has travelled since: windows are looked
/// for, spread over the session at first and beside a place once one was found, until two that share no scan agree on
/// it. Where the poses as given put a window is looked at like any other place: it must fit better than all others.
absl::StatusOr<SeedSearch> SearchMap(QueryBuilder& queries, std::span<const Pose> poses,
                                     std::span<const Window> windows, const TargetMap& map,
                                     const std::optional<Pose>& prior, const std::optional<PositionPrior>& position,
                                     const AlignParameters& parameters, const SearchProgress& progress);

/// Boxes about the sensor positions of a window under a correction, `reach` metres to every side.
Eigen::AlignedBox3d BoxOfWindow(const Window& window, std::span<const Pose> poses, const Pose& correction,
                                double reach);

/// T_map_session that puts the first scan at a position (metres, map frame) with a yaw (radians): roll and pitch stay
/// the odometry's own.
Pose PriorFrom(const Eigen::Vector3d& position, double yaw, const Pose& first);

/// Metres of travel between the middles of two windows. `travel` as TravelOf gives it.
double TravelBetween(const Window& a, const Window& b, std::span<const double> travel);

}  // namespace mapkeep
