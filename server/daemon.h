#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "server/config.h"

namespace mapkeep {

/// The running server: stores, pipeline and listeners, wired together.
class Daemon {
 public:
  /// Serves when it returns; sessions that an earlier daemon left unfinished are queued. FAILED_PRECONDITION if another
  /// process holds the data directory, UNAVAILABLE if an address cannot be had.
  static absl::StatusOr<std::unique_ptr<Daemon>> Start(Config config);

  /// As Stop.
  ~Daemon();

  /// Not ready any more, then the end of service in good order; jobs at work are handed back. Returns when all is done.
  void Stop();

  /// Where it listens, with the ports that were picked.
  Endpoint listen() const;
  Endpoint admin() const;
  Endpoint http() const;  ///< no host: off

 private:
  struct State;
  explicit Daemon(std::unique_ptr<State> state);

  std::unique_ptr<State> state_;
};

}  // namespace mapkeep
