#pragma once

#include "server/metrics/metrics.h"

namespace mapkeep {

/// What the system knows of this process: resident memory, open files, threads, seconds of processor time, start time.
void AddProcessMetrics(Metrics& metrics);

}  // namespace mapkeep
