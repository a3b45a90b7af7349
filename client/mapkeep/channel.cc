#include "client/mapkeep/channel.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <grpcpp/support/client_interceptor.h>

#include <fstream>
#include <string>
#include <utility>
#include <vector>

namespace mapkeep {
namespace {

constexpr int kLargestFrame = 1 << 20;     // bytes; a tile then comes in few pieces
constexpr int kLargestMessage = 64 << 20;  // bytes; tiles of many voxels are long
constexpr unsigned kSecondsBetweenLooks = 60;

bool UsesTls(const ClientOptions& options) {
  return options.tls || !options.tls_ca.empty() || !options.tls_cert.empty();
}

bool IsLoopback(const std::string& server) {
  return absl::StartsWith(server, "127.") || absl::StartsWith(server, "localhost:") ||
         absl::StartsWith(server, "[::1]:") || absl::StartsWith(server, "unix:");
}

// Puts the token on every call, of whatever service: credentials of gRPC's own would insist on TLS, also on loopback.
class TokenOnCall final : public grpc::experimental::Interceptor {
 public:
  explicit TokenOnCall(const std::string& header) : header_(header) {}

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(grpc::experimental::InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      methods->GetSendInitialMetadata()->emplace("authorization", header_);
    }
    methods->Proceed();
  }

 private:
  const std::string& header_;
};

class TokenOnCalls final : public grpc::experimental::ClientInterceptorFactoryInterface {
 public:
  explicit TokenOnCalls(const std::string& token) : header_(absl::StrCat("Bearer ", token)) {}

  grpc::experimental::Interceptor* CreateClientInterceptor(grpc::experimental::ClientRpcInfo*) override {
    return new TokenOnCall(header_);
  }

 private:
  const std::string header_;
};

std::shared_ptr<grpc::ChannelCredentials> CredentialsOf(const ClientOptions& options) {
  if (!UsesTls(options)) return grpc::InsecureChannelCredentials();
  grpc::experimental::TlsChannelCredentialsOptions tls;
  if (!options.tls_ca.empty() || !options.tls_cert.empty()) {
    tls.set_certificate_provider(std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
        options.tls_key, options.tls_cert, options.tls_ca, kSecondsBetweenLooks));
  }
  if (!options.tls_ca.empty()) tls.watch_root_certs();
  if (!options.tls_cert.empty()) tls.watch_identity_key_cert_pairs();
  return grpc::experimental::TlsCredentials(tls);
}

}  // namespace

absl::Status CheckCredentials(const ClientOptions& options) {
  if (options.tls_cert.empty() != options.tls_key.empty()) {
    return absl::InvalidArgumentError("a client's certificate needs both, certificate and key");
  }
  for (const std::string& file : {options.tls_ca, options.tls_cert, options.tls_key}) {
    if (!file.empty() && !std::ifstream(file))
      return absl::InvalidArgumentError(absl::StrCat(file, ": cannot be read"));
  }
  if (!options.token.empty() && !UsesTls(options) && !IsLoopback(options.server) && !options.insecure) {
    return absl::FailedPreconditionError(
        absl::StrCat("the token would go to ", options.server, " in the clear: use TLS, or allow it explicitly"));
  }
  return absl::OkStatus();
}

std::shared_ptr<grpc::Channel> MakeChannel(const ClientOptions& options) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kLargestMessage);
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_FRAME_SIZE, kLargestFrame);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 1000);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
  // A peer that vanished without a word is noticed within 40 s; the server allows pings every 10 s.
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 30000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10000);
  // Robots speak to their own server: a proxy from the environment is for the web.
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>> interceptors;
  if (!options.token.empty()) interceptors.push_back(std::make_unique<TokenOnCalls>(options.token));
  return grpc::experimental::CreateCustomChannelWithInterceptors(options.server, CredentialsOf(options), arguments,
                                                                 std::move(interceptors));
}

}  // namespace mapkeep
