#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "server/http/pages.h"

namespace mapkeep {

/// A tileset of the newest epoch (nothing) or a given one. Reads the store.
absl::StatusOr<PageResponse> TilesetPage(const PageContext& context, const PageRequest& request, const std::string& map,
                                         std::optional<uint64_t> epoch);

/// A file below epochs/{epoch}/tiles/. With `only_memory` nothing blocks: nothing if the answer is not at hand.
std::optional<absl::StatusOr<PageResponse>> TileFilePage(const PageContext& context, const PageRequest& request,
                                                         const std::string& map, uint64_t epoch,
                                                         const std::string& file, bool only_memory);

}  // namespace mapkeep
