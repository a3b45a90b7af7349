#pragma once

#include <absl/status/status.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/status.h>

#include <string>

#include "server/retry_delay.h"

namespace mapkeep {

/// The same code and message (the codes are the same numbers), with `details` for the client to parse. An error with a
/// retry delay has that for details, as google.rpc.Status with a google.rpc.RetryInfo.
grpc::Status ToGrpc(const absl::Status& status, const std::string& details = "");

/// Ends a call, with the trailer grpc-retry-pushback-ms if the error has a retry delay.
template <typename Reactor>
void FinishCall(grpc::CallbackServerContext& context, Reactor& reactor, const absl::Status& status,
                const std::string& details = "") {
  if (const auto delay = RetryDelayOf(status)) {
    context.AddTrailingMetadata("grpc-retry-pushback-ms", std::to_string(delay->count()));
  }
  reactor.Finish(ToGrpc(status, details));
}

}  // namespace mapkeep
