#include "server/metrics/pipeline_metrics.h"

#include <utility>

namespace mapkeep {
namespace {

const char* NameOf(SessionState state) {
  switch (state) {
    case SessionState::kCommitted:
      return "committed";
    case SessionState::kRefused:
      return "refused";
    case SessionState::kFailed:
      return "failed";
    default:
      return "other";
  }
}

// A stage of the pipeline takes from milliseconds to hours.
const prometheus::Histogram::BucketBoundaries kStageBuckets = {0.01, 0.1, 0.5, 1, 2, 5, 10, 30, 60, 300, 1800, 7200};

}  // namespace

PipelineEvents CountedEvents(Metrics& metrics, std::function<void(const SessionRecord&)> changed) {
  auto& stages = prometheus::BuildHistogram()
                     .Name("mapkeep_stage_seconds")
                     .Help("Stages of the pipeline, seconds a session")
                     .Register(metrics.registry());
  auto& ended = prometheus::BuildCounter()
                    .Name("mapkeep_sessions_ended_total")
                    .Help("Sessions that this daemon brought to their end")
                    .Register(metrics.registry());
  // There from the start, so that a rate over them begins at zero.
  for (const SessionState state : {SessionState::kCommitted, SessionState::kRefused, SessionState::kFailed}) {
    ended.Add({{"state", NameOf(state)}});
  }
  PipelineEvents events;
  events.stage_done = [&stages](const std::string& stage, double seconds) {
    stages.Add({{"stage", stage}}, kStageBuckets).Observe(seconds);
  };
  events.ended = [&ended](const SessionRecord& session) { ended.Add({{"state", NameOf(session.state)}}).Increment(); };
  events.changed = std::move(changed);
  return events;
}

}  // namespace mapkeep
