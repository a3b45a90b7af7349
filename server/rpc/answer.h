#pragma once

#include <absl/status/status.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <utility>

#include "server/rpc/grpc_status.h"
#include "server/work_pool.h"

namespace mapkeep {

/// Answers a unary call by running `work` (a callable that gives an absl::Status) on the pool, off gRPC's threads. The
/// request and the response live until the call is finished.
template <typename Work>
grpc::ServerUnaryReactor* Answer(grpc::CallbackServerContext* context, WorkPool& pool, Work work) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  pool.Submit([reactor, work = std::move(work)] { reactor->Finish(ToGrpc(work())); });
  return reactor;
}

}  // namespace mapkeep
