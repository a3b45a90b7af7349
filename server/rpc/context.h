#pragma once

#include <shared_mutex>

#include "server/config.h"
#include "server/epoch_feed.h"
#include "server/metrics/call_metrics.h"
#include "server/pipeline/pipeline.h"
#include "server/pipeline/plan_cache.h"
#include "server/pipeline/session_feed.h"
#include "server/quota/quotas.h"
#include "server/rpc/gate.h"
#include "server/work_pool.h"
#include "storage/map_store.h"
#include "storage/session_store.h"

namespace mapkeep {

/// What the services work with; all of it outlives them.
struct ServiceContext {
  Engine& engine;
  MapStore& maps;
  SessionStore& sessions;
  SessionFeed& feed;
  Pipeline& pipeline;
  PlanCache& plans;
  WorkPool& pool;
  WorkPool& staging;  ///< of uploads: gives way to `pool`
  const Config& config;
  const Gate& gate;
  CallMetrics& metrics;
  Quotas& quotas;
  /// Held alone to make or delete a map, shared to begin a session, so that no session begins in a map that goes.
  std::shared_mutex& map_lifetimes;
  EpochFeed& epochs;
};

}  // namespace mapkeep
