#pragma once

#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>

#include "server/rpc/context.h"
#include "server/rpc/upload_slots.h"

namespace mapkeep {

/// One UploadScans call, of UploadScansRequest and UploadScansResponse. gRPC's threads only hand over the bytes of
/// messages; decoding them, putting chunks together, checking and staging run on the pools, and nothing more is read
/// while limits.upload_pending_mib wait. Deletes itself.
grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* NewUpload(const ServiceContext& context,
                                                                       grpc::CallbackServerContext& stream, Call call,
                                                                       UploadSlots& slots);

}  // namespace mapkeep
