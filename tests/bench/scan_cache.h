#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "client/simulator/measurement.h"

namespace mapkeep {

/// The `count` labelled scans that `make` gives, from `file` if it holds those that `description` describes, otherwise
/// made (in parallel) and written there. An empty `file` keeps nothing. Intensities and times are not kept.
absl::StatusOr<std::vector<LabelledScan>> CachedScans(
    const std::filesystem::path& file, const std::string& description, size_t count,
    const std::function<absl::StatusOr<LabelledScan>(size_t index)>& make);

}  // namespace mapkeep
