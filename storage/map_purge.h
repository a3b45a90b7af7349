#pragma once

#include <absl/status/statusor.h>

#include <cstdint>

#include "storage/clock.h"
#include "storage/engine.h"

namespace mapkeep {

/// Removes an incarnation that no name leads to: first its head, after which no commit can succeed on it, then its
/// values, then its rows. False if an attempt is under way that may still write values: call again once it expired.
/// May be broken off anywhere and called again.
absl::StatusOr<bool> PurgeMap(Engine& engine, uint64_t incarnation, double now);

}  // namespace mapkeep
