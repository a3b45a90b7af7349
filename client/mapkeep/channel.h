#pragma once

#include <absl/status/status.h>
#include <grpcpp/channel.h>

#include <memory>

#include "client/mapkeep/client.h"

namespace mapkeep {

/// What keeps `options` from being used: a file that cannot be read, half of a certificate (INVALID_ARGUMENT), a token
/// that would cross a network in the clear (FAILED_PRECONDITION).
absl::Status CheckCredentials(const ClientOptions& options);

/// The channel: plain or TLS, with the token on every call. Certificates are read again when their files change.
std::shared_ptr<grpc::Channel> MakeChannel(const ClientOptions& options);

}  // namespace mapkeep
