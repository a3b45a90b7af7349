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

absl::StatusOr<SessionRecord> FindSession(const ServiceContext& context, const Call& call, Access access,
                                          const std::string& map, const std::string& id) {
  absl::StatusOr<SessionRecord> session = FindSession(context, map, id);
  if (!session.ok()) return session;
  if (absl::Status status = AllowSession(call.caller, access, session->robot); !status.ok()) return status;
  return session;
}

}  // namespace mapkeep
