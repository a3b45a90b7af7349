#pragma once

#include <grpcpp/support/server_callback.h>

#include "mapkeep/v1/map_service.pb.h"
#include "server/rpc/context.h"

namespace mapkeep {

/// The stream of CompareEpochs. Deletes itself.
grpc::ServerWriteReactor<v1::CompareEpochsResponse>* NewEpochComparison(const ServiceContext& context,
                                                                        const v1::CompareEpochsRequest& request);

}  // namespace mapkeep
