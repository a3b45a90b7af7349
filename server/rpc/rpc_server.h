#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <cstddef>
#include <memory>

#include "server/rpc/context.h"
#include "storage/cache_use.h"

namespace mapkeep {

/// The gRPC listener with every service, health and reflection.
class RpcServer {
 public:
  /// Listens at once. UNAVAILABLE if the address cannot be had.
  static absl::StatusOr<std::unique_ptr<RpcServer>> Start(const Endpoint& endpoint, const ServiceContext& context);
  ~RpcServer();

  int port() const { return port_; }

  /// Uploads under way.
  size_t uploads() const;

  /// Of the tiles that are kept as they are sent.
  CacheUse tile_cache() const;

  /// What the health service answers.
  void SetServing(bool serving);

  /// No further calls; uploads and watches end at once, the others get `patience`. Returns when all are done.
  void Shutdown(std::chrono::seconds patience);

 private:
  struct Services;
  RpcServer();

  std::unique_ptr<Services> services_;
  int port_ = 0;
};

}  // namespace mapkeep
