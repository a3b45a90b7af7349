#include "server/rpc/sessions.h"

#include "server/names.h"

namespace mapkeep {

absl::StatusOr<SessionRecord> FindSession(const ServiceContext& context, const std::string& map,
                                          const std::string& id) {
  if (absl::Status status = CheckName("map name", map); !status.ok()) return status;
  if (absl::Status status = CheckName("session id", id); !status.ok()) return status;
  absl::StatusOr<SessionRecord> session = context.sessions.Find(map, id);
  if (absl::IsNotFound(session.status())) {
    if (absl::Status status = context.maps.Find(map).status(); !status.ok()) return status;
  }
  return session;
}

}  // namespace mapkeep
