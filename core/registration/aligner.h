#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/progress.h"
#include "core/geometry/scan.h"
#include "core/registration/parameters.h"
#include "core/registration/position_prior.h"
#include "core/registration/target_map.h"

namespace mapkeep {

/// What became of one window W_u (eq. 1).
struct WindowResult {
  uint32_t first_scan = 0, last_scan = 0;  ///< inclusive
  double fitness = 0;  ///< f_u: share of query points within tau_d of the target, where it knows anything
  uint32_t inliers = 0;
  double correction = 0;     ///< metres between the prior and the refined pose
  double rotation = 0;       ///< radians between them
  double observability = 0;  ///< how well its surroundings fix the weakest direction (core/registration/fitness.h)
  bool trusted = false;
  double precision = 0;  ///< share of inliers on a surface of the target
  double coverage = 0;   ///< share of query points where the map knows anything
};

/// Where a session, or a few scans, came to lie.
enum class Verdict : uint8_t {
  kRefused,
  kAligned,
  kExtends,  ///< aligned; some windows lie beyond the map and are carried by odometry
};

struct Alignment {
  Verdict verdict = Verdict::kRefused;
  bool accepted = false;    ///< the verdict is not kRefused
  bool lacks_map = false;   ///< refused, and most of the session lies where the map knows nothing
  std::string reason;       ///< why it was refused; empty if accepted
  std::vector<Pose> poses;  ///< T^_{t,i}: one a scan, map frame; empty if refused
  std::vector<WindowResult> windows;
};

/// Aligns a session to the map. With a `prior` (T_map_session, roughly known) the windows are tracked from there, and
/// looked for near it if that fails. Without, they are looked for all over the map; where the poses as given put them
/// is one place of many. A place that was found counts only if what stands upright fits there, two windows that share
/// no scan agree on it and nothing else in the map fits nearly as well. Then GICP tracks from window to window, the
/// matcher is asked again where that is lost, and scan poses come from a pose graph over trusted windows and odometry
/// (or by eq. 2, as the parameters say). With a `position` of the first scan it is looked for only there, and refused
/// if it then lies more than kMostDeviations off. A session that finds no place is refused with the reason: not an
/// error. Deterministic on any number of threads. INVALID_ARGUMENT for counts that do not match; errors of the source
/// and of the map are passed on.
absl::StatusOr<Alignment> AlignSession(const ScanSource& scans, std::span<const Pose> poses, const TargetMap& map,
                                       const std::optional<Pose>& prior, const AlignParameters& parameters,
                                       const Progress& progress = {},
                                       const std::optional<PositionPrior>& position = {});

/// The session that founds a map: its poses as given are the map frame. Refused if its ground and walls say that z is
/// not up within 5 degrees.
absl::StatusOr<Alignment> FoundMapFrame(const ScanSource& scans, std::span<const Pose> poses,
                                        const AlignParameters& parameters, const Progress& progress = {});

}  // namespace mapkeep
