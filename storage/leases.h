#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "storage/clock.h"
#include "storage/engine.h"

namespace mapkeep {

/// The right to work on one session, held by one daemon until it expires. The fence grows with every new holder; a
/// commit requires that it has not moved, so that a worker that slept past its lease cannot commit.
struct Lease {
  std::string map, session, holder;
  uint64_t fence = 0;
  double expires = 0;  ///< seconds since 1970 (UTC)
};

/// Leases as rows in each map's head partition, beside the head that a commit compares. Thread-safe.
class Leases final {
 public:
  /// `engine` outlives it.
  Leases(Engine& engine, Clock now);

  /// NOT_FOUND without the map. ABORTED naming the holder while somebody else's lease has not expired; a holder of the
  /// same name takes its own over (a restarted daemon goes on at once).
  absl::StatusOr<Lease> Acquire(std::string_view map, std::string_view session, std::string_view holder,
                                double seconds);

  /// Moves the expiry; the fence stays. ABORTED if it was taken over or released.
  absl::StatusOr<Lease> Renew(const Lease& lease, double seconds);

  /// Fine if it was taken over meanwhile.
  absl::Status Release(const Lease& lease);

 private:
  Engine& engine_;
  Clock now_;
};

/// `engine` outlives it.
std::unique_ptr<Leases> OpenLeases(Engine& engine, Clock now = SystemSeconds);

}  // namespace mapkeep
