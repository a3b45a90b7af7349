#pragma once

#include <absl/status/statusor.h>

#include <atomic>
#include <memory>

#include "server/config.h"

namespace mapkeep {

/// The operator's HTTP/1.1 listener, on threads of its own: /livez says that the process runs, /readyz whether it takes
/// work (200 or 503).
class AdminServer {
 public:
  /// Listens at once. UNAVAILABLE if the address cannot be had.
  static absl::StatusOr<std::unique_ptr<AdminServer>> Start(const Endpoint& endpoint);
  ~AdminServer();

  int port() const { return port_; }
  void SetReady(bool ready) { ready_ = ready; }

 private:
  struct Listener;
  AdminServer();

  std::atomic<bool> ready_ = false;
  int port_ = 0;
  std::unique_ptr<Listener> listener_;
};

}  // namespace mapkeep
