#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <string_view>

#include "core/registration/wall_plan.h"

namespace mapkeep {

// The plan of a tile as the store keeps it beside the tile:
//
//   plan   := 'P' version(1) walls(4) floors(4) frame
//   frame  := one zstd frame of columns: of the walls y step(4), x(4), facings(2), of the floors y step(4), x(4),
//             height(4, IEEE 754), each in byte planes
//
// Numbers are little-endian, steps are from the row before. What has another version is made anew.

/// INTERNAL if compression fails.
absl::StatusOr<std::string> EncodePlan(const PlanPart& plan);

/// DATA_LOSS if the bytes are not a plan of this version.
absl::StatusOr<PlanPart> DecodePlan(std::string_view bytes);

}  // namespace mapkeep
