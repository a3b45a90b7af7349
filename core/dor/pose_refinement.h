#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <vector>

#include "core/dor/parameters.h"
#include "core/dor/scan_loop.h"
#include "core/geometry/pose.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// The poses with the noise from scan to scan taken out: every scan is laid onto the planes that all scans of the
/// session make together (point to plane, robust). Surfaces that a noisy pose lifts off themselves are looked through,
/// which costs static points. Poses that are good already are left as they are: what could be gained is within the
/// noise of the planes. What the session's surroundings leave open stays as given, and the session as a whole does not
/// move. Sums over scans are of integers, so the result does not depend on the number of threads. Errors as
/// RemoveDynamicObjects.
absl::StatusOr<std::vector<Pose>> RefinePoses(const ScanSource& scans, std::span<const Pose> poses,
                                              const PoseRefinementParameters& parameters,
                                              const ProgressPart& progress = {});

}  // namespace mapkeep
