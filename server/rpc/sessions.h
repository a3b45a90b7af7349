#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "server/rpc/context.h"

namespace mapkeep {

/// INVALID_ARGUMENT for a bad name, NOT_FOUND naming the map or the session that is missing.
absl::StatusOr<SessionRecord> FindSession(const ServiceContext& context, const std::string& map, const std::string& id);

/// Likewise for a call with `access`. PERMISSION_DENIED if the session is not the caller's and would have to be.
absl::StatusOr<SessionRecord> FindSession(const ServiceContext& context, const Call& call, Access access,
                                          const std::string& map, const std::string& id);

}  // namespace mapkeep
