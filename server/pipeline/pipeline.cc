#include "server/pipeline/pipeline.h"

#include <malloc.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/task_arena.h>
#include <oneapi/tbb/task_scheduler_observer.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "server/background.h"
#include "server/log.h"
#include "server/pipeline/job_queue.h"

namespace mapkeep {
namespace {

// After which a session is tried again: that another daemon is at, that waits for an earlier one of its map, and that
// the store's trouble kept from ending (twice as long each time, up to the longest).
constexpr std::chrono::milliseconds kLeasedPause{1000}, kTurnPause{200}, kTroublePause{1000}, kLongestPause{16000};

// A session that the map was too small for is tried again after as many commits at most.
constexpr uint32_t kMostRetries = 3;

// Renews a lease until it is destroyed; tells the job to stop if somebody else has taken it.
class LeaseRenewal {
 public:
  LeaseRenewal(Leases& leases, Lease lease, double seconds, Job& job)
      : thread_([this, &leases, lease = std::move(lease), seconds, &job](const std::stop_token& stop) mutable {
          std::unique_lock lock(mutex_);
          while (!changed_.wait_for(lock, stop, std::chrono::duration<double>(seconds / 3), [] { return false; })) {
            if (stop.stop_requested()) return;
            absl::StatusOr<Lease> renewed = leases.Renew(lease, seconds);
            if (renewed.ok()) {
              lease = *std::move(renewed);
            } else if (absl::IsAborted(renewed.status())) {
              StopReason none = StopReason::kNone;
              job.stop.compare_exchange_strong(none, StopReason::kLeaseLost);
              return;
            }
          }
        }) {}

 private:
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::jthread thread_;
};

// oneTBB's own threads do nothing that anybody waits for at once.
class WorkersGiveWay final : public tbb::task_scheduler_observer {
 public:
  WorkersGiveWay() { observe(true); }
  ~WorkersGiveWay() override { observe(false); }
  void on_scheduler_entry(bool is_worker) override {
    thread_local bool has = false;
    if (is_worker && !std::exchange(has, true)) GiveWay();
  }
};

}  // namespace

struct Pipeline::State {
  State(const PipelineStores& used, PipelineOptions given)
      : stores(used),
        options(std::move(given)),
        threads(options.threads > 0 ? options.threads : tbb::info::default_concurrency()),
        parallelism(tbb::global_control::max_allowed_parallelism, threads) {}

  void Work() {
    GiveWay();
    tbb::task_arena arena(threads);
    while (const std::shared_ptr<Job> job = queue.Take()) {
      if (!IsItsTurn(*job)) {
        queue.PutOff(job, kTurnPause);
        continue;
      }
      bool leased = false;
      const absl::Status status = RunLeased(arena, *job, leased);
      stores.feed.ClearProgress({job->map, job->session});
      malloc_trim(0);  // a session takes much for a while; what is free goes back, whichever thread took it
      const bool handed_on = job->stop == StopReason::kHandBack || job->stop == StopReason::kMapDeleted;
      if (status.ok() || handed_on || absl::IsNotFound(status)) {
        queue.Done(*job);
      } else if (!leased || job->stop == StopReason::kLeaseLost) {
        queue.PutOff(job, kLeasedPause);  // another daemon is at it
      } else {
        LogWarning("session put off", {{"map", job->map}, {"session", job->session}, {"why", status.ToString()}});
        queue.PutOff(job, std::min(kLongestPause, kTroublePause * (1 << std::min(job->troubles++, 10))));
      }
    }
  }

  // Whether no other session of the map has to be merged before, wherever it is queued. If the store cannot say, the
  // job finds out what is wrong with it.
  bool IsItsTurn(const Job& job) const {
    if (!options.serial_per_map) return true;
    const auto first = stores.sessions.FirstUnfinished(job.map);
    return !first.ok() || !*first || **first == job.session;
  }

  // A commit may have brought the map that refused sessions of it lacked.
  void RetryRefused(const Job& job) {
    auto lacking = stores.sessions.LackingMap(job.map);
    if (!lacking.ok()) return;
    for (SessionRecord& session : *lacking) {
      if (session.retries >= kMostRetries) continue;
      session.state = SessionState::kQueued;
      session.ended = 0;
      ++session.retries;
      if (!stores.sessions.Update(session, SessionState::kRefused).ok()) continue;
      LogInfo("session tried again",
              {{"map", session.map}, {"session", session.id}, {"retries", session.retries}, {"after", job.session}});
      stores.feed.Changed({session.map, session.id});
      if (stores.events != nullptr && stores.events->changed) stores.events->changed(session);
      queue.Push(session.map, session.id, false, session.turn);
    }
  }

  absl::Status RunLeased(tbb::task_arena& arena, Job& job, bool& leased) {
    const auto lease = stores.leases.Acquire(job.map, job.session, options.holder, options.lease_seconds);
    leased = !absl::IsAborted(lease.status());
    if (!lease.ok()) return lease.status();
    LogInfo("session started", {{"map", job.map}, {"session", job.session}, {"resumed", job.resumed ? 1 : 0}});
    absl::Status status;
    {
      const LeaseRenewal renewal(stores.leases, *lease, options.lease_seconds, job);
      status = arena.execute(
          [&] { return RunSession(stores, options.stages, job, lease->fence, {}, [&] { RetryRefused(job); }); });
    }
    if (job.stop == StopReason::kHandBack && !status.ok()) {
      // It stays in state running, so that the next start takes it up before any other.
      LogInfo("session handed back", {{"map", job.map}, {"session", job.session}});
    }
    const absl::Status released = stores.leases.Release(*lease);
    if (!released.ok() && !absl::IsNotFound(released)) {
      LogWarning("lease not released", {{"session", job.session}, {"why", released.ToString()}});
    }
    return status;
  }

  PipelineStores stores;
  const PipelineOptions options;
  const int threads;
  const tbb::global_control parallelism;
  const WorkersGiveWay workers_give_way;
  JobQueue queue;
  std::vector<std::jthread> workers;
};

Pipeline::Pipeline(const PipelineStores& stores, PipelineOptions options)
    : state_(std::make_unique<State>(stores, std::move(options))) {
  for (int i = 0; i < state_->options.jobs; ++i) {
    state_->workers.emplace_back([state = state_.get()] { state->Work(); });
  }
}

Pipeline::~Pipeline() { Close(); }

absl::Status Pipeline::ResumeUnfinished() {
  const auto unfinished = state_->stores.sessions.Unfinished();
  if (!unfinished.ok()) return unfinished.status();
  for (const SessionRecord& session : *unfinished) {
    const absl::Status map = state_->stores.maps.Find(session.map).status();
    if (absl::IsNotFound(map)) {
      // The daemon ended between deleting the map and deleting its sessions.
      if (absl::Status status = state_->stores.sessions.DeleteAll(session.map); !status.ok()) return status;
      continue;
    }
    Push(session);
  }
  return absl::OkStatus();
}

void Pipeline::Push(const SessionRecord& session) {
  state_->queue.Push(session.map, session.id, session.state == SessionState::kRunning, session.turn);
}

JobQueueStatus Pipeline::Status() const { return state_->queue.Status(); }

void Pipeline::StopMap(std::string_view map) { state_->queue.StopMap(map, StopReason::kMapDeleted); }

void Pipeline::Close() { state_->queue.Close(StopReason::kHandBack); }

}  // namespace mapkeep
