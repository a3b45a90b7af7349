#include "server/exposure.h"

#include <absl/strings/str_format.h>
#include <arpa/inet.h>

#include <string>
#include <utility>

namespace mapkeep {

bool IsLoopback(std::string_view host) {
  const std::string text(host);
  in_addr v4{};
  in6_addr v6{};
  if (inet_pton(AF_INET, text.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  if (inet_pton(AF_INET6, text.c_str(), &v6) == 1) {
    const bool mapped = IN6_IS_ADDR_V4MAPPED(&v6) != 0;
    return IN6_IS_ADDR_LOOPBACK(&v6) != 0 || (mapped && v6.s6_addr[12] == 127);
  }
  return text == "localhost";
}

absl::Status CheckExposure(const Config& config) {
  const Security& security = config.security;
  if (security.tls_cert.empty() != security.tls_key.empty()) {
    return absl::InvalidArgumentError(absl::StrFormat("%s is given without %s: TLS needs both",
                                                      security.tls_cert.empty() ? "--tls-key" : "--tls-cert",
                                                      security.tls_cert.empty() ? "--tls-cert" : "--tls-key"));
  }
  if (!security.tls_client_ca.empty() && security.tls_cert.empty()) {
    return absl::InvalidArgumentError("--tls-client-ca is given without --tls-cert and --tls-key");
  }
  if (security.insecure) return absl::OkStatus();
  const char* missing = nullptr;
  if (security.tls_cert.empty()) missing = "TLS (--tls-cert, --tls-key)";
  if (security.tokens.empty()) {
    missing = missing == nullptr ? "tokens (--tokens)" : "TLS (--tls-cert, --tls-key) and tokens (--tokens)";
  }
  if (missing == nullptr) return absl::OkStatus();
  for (const auto& [flag, endpoint] :
       {std::pair("--listen", config.listen), std::pair("--admin", config.admin), std::pair("--http", config.http)}) {
    if (endpoint.host.empty() || IsLoopback(endpoint.host)) continue;
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s %s: other machines reach it, so it needs %s; --insecure does without", flag, ToString(endpoint), missing));
  }
  return absl::OkStatus();
}

}  // namespace mapkeep
