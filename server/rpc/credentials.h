#pragma once

#include <grpcpp/security/server_credentials.h>

#include <memory>

#include "server/config.h"

namespace mapkeep {

/// Of the gRPC listener: plain without a certificate; else TLS with the files of `security`, read again within seconds
/// of a change, and with a certificate asked of every client if tls_client_ca is given.
std::shared_ptr<grpc::ServerCredentials> ServerCredentialsOf(const Security& security);

}  // namespace mapkeep
