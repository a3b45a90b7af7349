#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>

#include "core/registration/match_cloud.h"
#include "core/registration/parameters.h"
#include "core/registration/placement.h"
#include "core/registration/plan_search.h"
#include "core/registration/target_map.h"

namespace mapkeep {

/// Where one window was found.
struct FoundPlace {
  Placement placement;     ///< the best place, refined
  size_t matches = 0;      ///< walls or descriptors that agree with it; 0: there is no place at all
  bool fits = false;       ///< the place fits (FitsMap, StructureFits), and nothing else in the map fits nearly as well
  StructureFit structure;  ///< of the best place, if it was found from above
  double rival = 0;        ///< score of the best other place that was looked at; by descriptors: its surface share
  std::string reason;      ///< why it does not fit; empty if it does
};

/// Where a window (points in its own frame, facing its sensors) lies in the map, or in the part of it in the box:
/// candidates from above and the `guess` (T_map_window) if there is one, each refined by GICP; the one whose structure
/// fits best is compared with its rivals, and every place was looked at. Where there is none from above at all,
/// candidates of the global matcher, and as rivals what a second match finds that leaves out everything near the best
/// place. Errors of the map are passed on.
absl::StatusOr<FoundPlace> FindPlace(const FacingPoints& query, const TargetMap& map,
                                     const std::optional<Eigen::AlignedBox3d>& within, const std::optional<Pose>& guess,
                                     const AlignParameters& parameters);

/// Whether two poses of a window are one place: candidates that refine to it are one, too.
bool SamePlace(const Pose& a, const Pose& b);

/// The box about points that lie at `pose`, grown by `margin` metres.
Eigen::AlignedBox3d BoxAbout(std::span<const Eigen::Vector3d> points, const Pose& pose, double margin);

}  // namespace mapkeep
