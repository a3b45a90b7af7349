#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "server/http/pages.h"

namespace mapkeep {

/// The stream of a map's events; see pages.h. Reads the store.
absl::StatusOr<PageResponse> EventsPage(const PageContext& context, const PageRequest& request, const std::string& map);

}  // namespace mapkeep
