#include "server/pipeline/pipeline.h"

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/task_arena.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "server/log.h"
#include "server/pipeline/job_queue.h"

namespace mapkeep {
namespace {

// A session that a lease or the store kept from ending is tried again after this.
constexpr std::chrono::seconds kRetryPause{1};

// A session that the map was too small for is tried again after as many commits at most.
constexpr uint32_t kMostRetries = 3;
constexpr size_t kRetryPage = 100;

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

}  // namespace

struct Pipeline::State {
  State(const PipelineStores& used, PipelineOptions given)
      : stores(used),
        options(std::move(given)),
        threads(options.threads > 0 ? options.threads : tbb::info::default_concurrency()),
        parallelism(tbb::global_control::max_allowed_parallelism, threads) {}

  void Work(const std::stop_token& stop) {
    tbb::task_arena arena(threads);
    while (const std::shared_ptr<Job> job = queue.Take()) {
      bool leased = false;
      const absl::Status status = RunLeased(arena, *job, leased);
      stores.feed.ClearProgress({job->map, job->session});
      queue.Done(*job);
      if (status.ok()) RetryRefused(*job);
      if (status.ok() || job->stop != StopReason::kNone || absl::IsNotFound(status)) continue;
      if (leased) {
        LogWarning("session put off", {{"map", job->map}, {"session", job->session}, {"why", status.ToString()}});
      }  // otherwise another daemon is at it
      std::unique_lock lock(pause_mutex);
      pause.wait_for(lock, stop, kRetryPause, [] { return false; });
      queue.Push(job->map, job->session, true, job->created);
    }
  }

  // A commit may have brought the map that refused sessions of it lacked.
  void RetryRefused(const Job& job) {
    const auto ended = stores.sessions.Find(job.map, job.session);
    if (!ended.ok() || ended->state != SessionState::kCommitted) return;
    std::string after;
    do {
      const auto page = stores.sessions.List(job.map, after, kRetryPage);
      if (!page.ok()) return;
      for (SessionRecord session : page->sessions) {
        if (session.state != SessionState::kRefused || !session.lacks_map || session.scans_deleted ||
            session.retries >= kMostRetries) {
          continue;
        }
        session.state = SessionState::kQueued;
        session.ended = 0;
        ++session.retries;
        if (!stores.sessions.Update(session, SessionState::kRefused).ok()) continue;
        LogInfo("session tried again",
                {{"map", session.map}, {"session", session.id}, {"retries", session.retries}, {"after", job.session}});
        stores.feed.Changed({session.map, session.id});
        if (stores.events != nullptr && stores.events->changed) stores.events->changed(session);
        queue.Push(session.map, session.id, false, session.created);
      }
      after = page->next;
    } while (!after.empty());
  }

  absl::Status RunLeased(tbb::task_arena& arena, Job& job, bool& leased) {
    const auto lease = stores.leases.Acquire(job.map, job.session, options.holder, options.lease_seconds);
    leased = !absl::IsAborted(lease.status());
    if (!lease.ok()) return lease.status();
    LogInfo("session started", {{"map", job.map}, {"session", job.session}, {"resumed", job.resumed ? 1 : 0}});
    absl::Status status;
    {
      const LeaseRenewal renewal(stores.leases, *lease, options.lease_seconds, job);
      status = arena.execute([&] { return RunSession(stores, options.stages, job, lease->fence); });
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
  JobQueue queue;
  std::mutex pause_mutex;
  std::condition_variable_any pause;
  std::vector<std::jthread> workers;
};

Pipeline::Pipeline(const PipelineStores& stores, PipelineOptions options)
    : state_(std::make_unique<State>(stores, std::move(options))) {
  for (int i = 0; i < state_->options.jobs; ++i) {
    state_->workers.emplace_back([state = state_.get()](const std::stop_token& stop) { state->Work(stop); });
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
  state_->queue.Push(session.map, session.id, session.state == SessionState::kRunning, session.created);
}

JobQueueStatus Pipeline::Status() const { return state_->queue.Status(); }

void Pipeline::StopMap(std::string_view map) { state_->queue.StopMap(map, StopReason::kMapDeleted); }

void Pipeline::Close() {
  state_->queue.Close(StopReason::kHandBack);
  for (std::jthread& worker : state_->workers) worker.request_stop();
}

}  // namespace mapkeep
