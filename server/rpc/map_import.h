#pragma once

#include <grpcpp/support/server_callback.h>

#include "mapkeep/v1/map_service.pb.h"
#include "server/rpc/context.h"
#include "server/rpc/gate.h"

namespace mapkeep {

/// One ImportMap call. Blocks go into a store of the call's own, some at a time, and from there into the daemon's in
/// one last step, so that neither memory nor what others see depends on how large the map is. Deletes itself.
grpc::ServerReadReactor<v1::ImportMapRequest>* NewMapImport(const ServiceContext& context, Call call,
                                                            v1::ImportMapResponse* response);

}  // namespace mapkeep
