#pragma once

#include "server/metrics/metrics.h"
#include "server/pipeline/run_session.h"

namespace mapkeep {

/// Events that count into `metrics`, which outlives them: mapkeep_stage_seconds{stage},
/// mapkeep_sessions_ended_total{state}. `changed` is passed on.
PipelineEvents CountedEvents(Metrics& metrics, std::function<void(const SessionRecord&)> changed = {});

}  // namespace mapkeep
