#pragma once

#include <absl/status/statusor.h>

#include <string>

namespace mapkeep {

/// The well-known text (OGC 01-009, as LAS wants it) of "EPSG:N". FAILED_PRECONDITION if PROJ does not know the system,
/// or if its axes are not two lengths in metres: a map's coordinates are metres.
absl::StatusOr<std::string> WellKnownTextOf(const std::string& crs);

}  // namespace mapkeep
