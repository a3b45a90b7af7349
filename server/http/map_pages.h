#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "server/auth/access.h"
#include "server/http/pages.h"

namespace mapkeep {

// The pages that are messages of the protos as JSON. They read the store.

absl::StatusOr<PageResponse> ListMapsPage(const PageContext& context, const Caller& caller,
                                          const RequestTarget& target);
absl::StatusOr<PageResponse> MapPage(const PageContext& context, const std::string& map);
absl::StatusOr<PageResponse> EpochsPage(const PageContext& context, const std::string& map,
                                        const RequestTarget& target);
absl::StatusOr<PageResponse> SessionsPage(const PageContext& context, const std::string& map,
                                          const RequestTarget& target);
absl::StatusOr<PageResponse> SessionPage(const PageContext& context, const std::string& map, const std::string& id);
absl::StatusOr<PageResponse> PosesPage(const PageContext& context, const std::string& map, const std::string& id,
                                       const RequestTarget& target);
absl::StatusOr<PageResponse> VoxelPage(const PageContext& context, const std::string& map, const RequestTarget& target);

/// An epoch's Version with "kind": "empty", "session" or "rollback", as one line of JSON.
absl::StatusOr<std::string> EpochJson(const MapVersion& version);
/// A session as one line of JSON.
absl::StatusOr<std::string> SessionJson(const PageContext& context, const SessionRecord& session);

}  // namespace mapkeep
