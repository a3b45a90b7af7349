#pragma once

#include <absl/status/statusor.h>

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include "server/auth/authority.h"
#include "server/auth/certificates.h"
#include "server/config.h"

namespace mapkeep {

/// What the admin listener serves and how it is guarded. What is pointed to outlives it.
struct AdminServerParts {
  const Authority& authority;
  const Certificates* certificates = nullptr;  ///< nullptr: plain HTTP
  std::function<std::string()> metrics;        ///< the text of /metrics
};

/// HTTP for probes and Prometheus, on threads of its own, so that nothing else can keep it from answering: /livez
/// (200 while the process is), /readyz (200 while it takes work, else 503), /metrics. The probes tell nothing and ask
/// no token; /metrics asks for one that reads every map, if the daemon has tokens.
class AdminServer {
 public:
  /// Listens at once, not ready yet. UNAVAILABLE if the address cannot be had.
  static absl::StatusOr<std::unique_ptr<AdminServer>> Start(const Endpoint& endpoint, AdminServerParts parts);
  ~AdminServer();

  int port() const { return port_; }

  void SetReady(bool ready) { ready_ = ready; }
  bool ready() const { return ready_; }

 private:
  struct Listener;
  explicit AdminServer(AdminServerParts parts);

  const AdminServerParts parts_;
  int port_ = 0;
  std::atomic<bool> ready_ = false;
  std::unique_ptr<Listener> listener_;
};

}  // namespace mapkeep
