#pragma once

#include <span>
#include <vector>

#include "core/geometry/pose.h"
#include "core/registration/fusion.h"
#include "core/registration/placement.h"

namespace mapkeep {

/// Scan poses in the map frame by least squares over scans and windows: odometry ties each scan to the next (its error
/// grows with the step), each trusted window ties its scans' mean correction to where GICP put it, as firmly as its
/// surfaces fix it in each direction, with a robust loss, and each scan that was placed on its own is tied to its place
/// as its own surfaces fix it: that takes out the noise that every pose of odometry has for itself. Drift is spread
/// where odometry says it can be; scans beyond the first and last trusted window are carried by odometry. `trusted`
/// must not be empty. One thread: the same input gives the same bits. `scans` holds one entry a scan, or nothing.
std::vector<Pose> OptimisePoses(std::span<const Pose> poses, std::span<const TrustedWindow> trusted,
                                std::span<const ScanPlacement> scans = {});

}  // namespace mapkeep
