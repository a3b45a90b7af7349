#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

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
class Leases {
 public:
  virtual ~Leases() = default;
  /// ABORTED naming the holder while somebody else's lease has not expired; a holder of the same name takes its own
  /// over (a restarted daemon goes on at once).
  virtual absl::StatusOr<Lease> Acquire(std::string_view map, std::string_view session, std::string_view holder,
                                        double seconds) = 0;
  /// ABORTED if it was taken over.
  virtual absl::StatusOr<Lease> Renew(const Lease& lease, double seconds) = 0;
  /// Fine if it was taken over meanwhile.
  virtual absl::Status Release(const Lease& lease) = 0;
};

/// `engine` outlives it.
std::unique_ptr<Leases> OpenLeases(Engine& engine);

}  // namespace mapkeep
