#pragma once

#include <absl/status/status.h>

#include <string_view>

namespace mapkeep {

/// Names of maps and ids of sessions: [A-Za-z0-9][A-Za-z0-9._:-]{0,127}. INVALID_ARGUMENT naming `what` (as in "map
/// name") and the rule otherwise.
absl::Status CheckName(std::string_view what, std::string_view name);

/// Like CheckName, but may be empty.
absl::Status CheckOptionalName(std::string_view what, std::string_view name);

/// A coordinate reference system: empty, or "EPSG:N" with 1 to 6 digits.
absl::Status CheckCrs(std::string_view crs);

}  // namespace mapkeep
