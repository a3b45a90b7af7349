#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <optional>

namespace mapkeep {

/// The same error, and when it is worth trying again. The service layer tells clients in each protocol's way.
absl::Status WithRetryDelay(absl::Status status, std::chrono::milliseconds delay);

/// Nothing if the error says none.
std::optional<std::chrono::milliseconds> RetryDelayOf(const absl::Status& status);

}  // namespace mapkeep
