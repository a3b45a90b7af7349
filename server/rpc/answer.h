#pragma once

#include <absl/status/status.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <type_traits>
#include <utility>

#include "server/rpc/context.h"
#include "server/rpc/gate.h"
#include "server/rpc/grpc_status.h"

namespace mapkeep {

/// Answers a unary call, if the gate admits it, by running `work` on the pool, off gRPC's threads: a callable that
/// gives an absl::Status and may take the Call. The request and the response live until the call is finished.
template <typename Request, typename Work>
grpc::ServerUnaryReactor* Answer(grpc::CallbackServerContext* context, const ServiceContext& service,
                                 const Request& request, Work work) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  absl::StatusOr<Call> call = service.gate.Admit(*context, request);
  if (!call.ok()) {
    reactor->Finish(ToGrpc(call.status()));
    return reactor;
  }
  service.pool.Submit([context, reactor, call = *std::move(call), work = std::move(work)] {
    const LogScope scope(call.tags());
    absl::Status status;
    if constexpr (std::is_invocable_v<Work, const Call&>) {
      status = work(call);
    } else {
      status = work();
    }
    FinishCall(*context, *reactor, status);
  });
  return reactor;
}

}  // namespace mapkeep
