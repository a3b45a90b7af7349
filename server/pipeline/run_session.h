#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "core/geometry/progress.h"
#include "server/config.h"
#include "server/pipeline/job_queue.h"
#include "server/pipeline/plan_cache.h"
#include "server/pipeline/session_feed.h"
#include "server/pipeline/session_scans.h"
#include "storage/leases.h"
#include "storage/map_store.h"
#include "storage/session_store.h"

namespace mapkeep {

/// What others may want to count. Called by the workers; must not block.
struct PipelineEvents {
  std::function<void(const std::string& stage, double seconds)> stage_done;
  std::function<void(const SessionRecord& session)> ended;    ///< here: committed, refused or failed
  std::function<void(const SessionRecord& session)> changed;  ///< what a session's record is now
};

/// What the pipeline works with. All of it outlives the pipeline.
struct PipelineStores {
  MapStore& maps;
  SessionStore& sessions;
  Leases& leases;
  SessionFeed& feed;
  PlanCache& plans;
  const PipelineEvents* events = nullptr;  ///< nullptr: nobody counts
  ScanMemory* scan_memory = nullptr;       ///< nullptr: every stage reads the scans from the store
};

/// Takes one session through all stages on the calling oneTBB arena and writes its end (committed, refused, failed)
/// into its record. Safe to run again at any point where an earlier run was cut off: what is committed is found and
/// only concluded. CANCELLED if `job` was told to stop, ABORTED if the lease moved on: then the record is left as it
/// is, and
/// likewise on UNAVAILABLE, RESOURCE_EXHAUSTED, UNKNOWN and DEADLINE_EXCEEDED: trouble of the store, which passes.
/// `fence` is that of the job's lease. Aligns to the newest epoch, or to `base_epoch`: for replays. `merged` is called
/// once the session is in the map, before its record says so: what is to follow from that happens even if this process
/// ends here.
absl::Status RunSession(const PipelineStores& stores, const StageParameters& parameters, Job& job, uint64_t fence,
                        std::optional<uint64_t> base_epoch = {}, const std::function<void()>& merged = {});

/// Minutes since 2000-01-01 UTC of seconds since 1970; 0 for what came before.
uint32_t MinutesSince2000(double seconds);

}  // namespace mapkeep
