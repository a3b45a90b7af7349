#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>

#include "core/registration/match_cloud.h"
#include "core/registration/parameters.h"
#include "core/registration/placement.h"
#include "core/registration/target_map.h"

namespace mapkeep {

/// What the global matcher made of one window.
struct FoundPlace {
  Placement placement;  ///< the best place, refined
  size_t matches = 0;   ///< descriptor matches that agree with it; 0: there is no place at all
  bool fits = false;    ///< the place passes FitsMapWithoutPrior, and nothing else in the map fits nearly as well
  double rival = 0;     ///< surface share of the best other place that was looked at
  std::string reason;   ///< why it does not fit; empty if it does
};

/// Where a window (points in its own frame, facing its sensors) lies in the map, or in the part of it in the box:
/// candidates of the global matcher, each refined by GICP and fitted. The best one is compared with its rivals: the
/// other candidates, and what a second match finds that leaves out everything near the best place. Errors of the map
/// are passed on.
absl::StatusOr<FoundPlace> FindPlace(const FacingPoints& query, const TargetMap& map,
                                     const std::optional<Eigen::AlignedBox3d>& within,
                                     const AlignParameters& parameters);

/// The box about points that lie at `pose`, grown by `margin` metres.
Eigen::AlignedBox3d BoxAbout(std::span<const Eigen::Vector3d> points, const Pose& pose, double margin);

}  // namespace mapkeep
