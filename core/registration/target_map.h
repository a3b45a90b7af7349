#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Geometry>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/registration/global_matcher.h"
#include "core/registration/wall_plan.h"

namespace mapkeep {

/// The registration target C_{t-1}: static voxels of the map. Columns of equal length.
struct RegistrationTarget {
  double voxel_size = 0;                 ///< metres, the map's
  std::vector<Eigen::Vector3d> points;   ///< mean points, map frame
  std::vector<Eigen::Vector3d> normals;  ///< unit, towards the free side; or zero where unknown
};

/// The map as registration reads it: never more than is asked for. `points` may be called from several threads at once,
/// the others from one at a time; all give the same bytes every time.
struct TargetMap {
  /// The static voxels in any of the boxes (and perhaps some around them).
  std::function<absl::StatusOr<RegistrationTarget>(std::span<const Eigen::AlignedBox3d> boxes)> points;
  /// What to match a cloud with: targets of the map, or of the part in the box, at a fine and a coarse voxel size, to
  /// be tried in that order. `source` is what is to be found: a large map looks only where it may lie.
  std::function<absl::StatusOr<std::vector<std::shared_ptr<const MatchTarget>>>(
      const FacingPoints& source, const std::optional<Eigen::AlignedBox3d>& within)>
      match_targets;
  /// The whole map from above, for the search of places.
  std::function<absl::StatusOr<std::shared_ptr<const WallPlan>>()> plan;
};

/// A map held in memory, described when first asked for.
TargetMap MapOf(RegistrationTarget target, const MatcherParameters& parameters = {});

/// The voxel sizes of matching, in the order in which they are tried, metres.
inline constexpr double kMatchVoxels[] = {0.5, 1.0};

}  // namespace mapkeep
