#pragma once

#include <absl/status/statusor.h>

#include "client/mapkeep/client.h"
#include "client/mapkeep/connection.h"

namespace mapkeep {

/// See Client::UploadSession.
absl::StatusOr<SessionInfo> UploadSession(const Connection& connection, const SessionUpload& upload,
                                          const std::function<bool(const UploadProgress&)>& progress);

}  // namespace mapkeep
