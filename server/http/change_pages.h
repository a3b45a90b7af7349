#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "server/http/pages.h"

namespace mapkeep {

/// How many voxels appeared, disappeared or became unstable from epoch `before` to `after`. Reads what differs alone.
absl::StatusOr<PageResponse> ChangeCountsPage(const PageContext& context, const PageRequest& request,
                                              const std::string& map, uint64_t before, uint64_t after);

/// Their points as glTF; beyond two million thinned to a coarser level.
absl::StatusOr<PageResponse> ChangePointsPage(const PageContext& context, const PageRequest& request,
                                              const std::string& map, uint64_t before, uint64_t after);

}  // namespace mapkeep
