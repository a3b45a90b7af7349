#pragma once

#include <memory>

#include "server/metrics/metrics.h"
#include "storage/engine.h"

namespace mapkeep {

/// The same engine, with every call timed and its errors and bytes counted:
/// mapkeep_engine_seconds{operation}, mapkeep_engine_errors_total{operation,code},
/// mapkeep_engine_bytes_total{operation}. `metrics` outlives it.
std::unique_ptr<Engine> Metered(std::unique_ptr<Engine> engine, Metrics& metrics);

}  // namespace mapkeep
