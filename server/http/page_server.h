#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "server/config.h"
#include "server/http/page.h"

using SSL_CTX = struct ssl_ctx_st;

namespace mapkeep {

/// Answers requests: calls `respond` once, now or later, from any thread. Must not block: what reads the store goes to
/// a pool.
using PageHandler = std::function<void(PageRequest request, Respond respond)>;

struct PageServerOptions {
  int threads = 2;            ///< that move bytes
  int connections = 1024;     ///< at most; the one that was silent longest makes room for a new one
  int stall_seconds = 30;     ///< after which a client that takes no byte, or does not finish its request, is cut off
  int idle_seconds = 75;      ///< between requests of one connection
  std::string cors_origins;   ///< whose pages may read answers: "*", origins separated by blanks, or nothing
  bool shared_caches = true;  ///< caches between here and the client may keep what is kept for ever
  std::function<void(SSL_CTX*)> tls;  ///< gives the context its certificate; null: no TLS
};

/// The HTTP/1.1 listener for pages and tiles, on threads of its own: asynchronous, so that a client that is slow holds
/// a buffer of the kernel's and nothing else. Knows nothing of maps.
class PageServer {
 public:
  /// Listens at once. UNAVAILABLE if the address cannot be had.
  static absl::StatusOr<std::unique_ptr<PageServer>> Start(const Endpoint& endpoint, const PageServerOptions& options,
                                                           PageHandler handler);
  /// As Stop without patience.
  ~PageServer();

  int port() const { return port_; }
  size_t connections() const;  ///< open now
  uint64_t requests() const;   ///< well-formed ones, since the start

  /// Takes no more connections, lets answers under way end, at most for `patience`; then closes everything. The handler
  /// is not called any more once this returns; answers that come later, but while this object lives, go nowhere.
  void Stop(std::chrono::seconds patience);

 private:
  struct Listener;
  PageServer();

  int port_ = 0;
  std::unique_ptr<Listener> listener_;
};

}  // namespace mapkeep
