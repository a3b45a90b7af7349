#pragma once

#include <grpcpp/support/server_callback.h>

#include "mapkeep/v1/tile_service.pb.h"
#include "server/rpc/context.h"

namespace mapkeep {

/// One WatchMap call: the newest epoch, or every one since the token, then each new one, until the daemon ends
/// (UNAVAILABLE) or limits.watch_seconds are over. Deletes itself.
grpc::ServerWriteReactor<v1::WatchMapResponse>* NewMapWatch(const ServiceContext& context,
                                                            const v1::WatchMapRequest& request);

}  // namespace mapkeep
