#pragma once

#include <grpcpp/support/server_callback.h>

#include "mapkeep/v1/session_service.pb.h"
#include "server/rpc/context.h"
#include "server/rpc/upload_slots.h"

namespace mapkeep {

/// One UploadScans call. gRPC's threads only put chunks together; checking and staging run on the pool, a batch at a
/// time, and nothing more is read while limits.upload_pending_mib of scans wait. Deletes itself.
grpc::ServerBidiReactor<v1::UploadScansRequest, v1::UploadScansResponse>* NewUpload(const ServiceContext& context,
                                                                                    grpc::CallbackServerContext& stream,
                                                                                    Call call, UploadSlots& slots);

}  // namespace mapkeep
