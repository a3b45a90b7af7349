#pragma once

#include <grpcpp/support/server_interceptor.h>

#include <memory>

#include "server/metrics/call_metrics.h"

namespace mapkeep {

/// Sees every call of every service begin and end: counts it, and logs those that fail (refused ones as warnings), at
/// most a hundred lines a second. Knows nothing of what is sent. `metrics` outlives the server.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> NewCallObserver(CallMetrics& metrics);

}  // namespace mapkeep
