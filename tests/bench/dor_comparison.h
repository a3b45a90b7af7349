#pragma once

#include <span>

#include "core/dor/parameters.h"
#include "core/geometry/pose.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// Prints, for the same scans in memory: the shares of removal's stages; our counting of exposures beside the exact
/// reference, a plain hash-set DDA and OctoMap, with ratios of processor time; what bounds us and how far the floor is;
/// and how the cost grows with scans and with points, 1x to 8x.
void PrintComparison(std::span<const Scan> scans, std::span<const Pose> poses, const DorParameters& parameters);

}  // namespace mapkeep
