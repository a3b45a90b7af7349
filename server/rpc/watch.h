#pragma once

#include <grpcpp/support/server_callback.h>

#include "mapkeep/v1/session_service.pb.h"
#include "server/rpc/context.h"

namespace mapkeep {

/// One WatchSession call: the session now and after each change (changes that come while a message is on its way are
/// one), until it has ended, the daemon ends (UNAVAILABLE) or limits.watch_seconds are over. Deletes itself.
grpc::ServerWriteReactor<v1::WatchSessionResponse>* NewWatch(const ServiceContext& context, Call call);

}  // namespace mapkeep
