#pragma once

#include <absl/status/status.h>
#include <absl/time/time.h>

#include <optional>
#include <string>

namespace mapkeep {

/// The google.rpc.RetryInfo in an error's details (a serialised google.rpc.Status); nothing if there is none. The bytes
/// are the server's, or of whoever stands between.
std::optional<absl::Duration> RetryDelayIn(const std::string& details);

/// Keeps a delay with an error.
absl::Status KeepRetryDelay(absl::Status status, absl::Duration delay);
/// The delay that was kept with it.
std::optional<absl::Duration> KeptRetryDelay(const absl::Status& status);

}  // namespace mapkeep
