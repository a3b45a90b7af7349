#include "server/pipeline/job_queue.h"

#include <algorithm>

namespace mapkeep {

void JobQueue::Push(std::string map, std::string session, bool resumed, uint64_t turn) {
  {
    const std::lock_guard lock(mutex_);
    if (closed_ || !known_.emplace(map, session).second) return;
    auto job = std::make_shared<Job>(std::move(map), std::move(session), resumed, turn);
    waiting_.emplace(OrderOf(*job), job);
  }
  changed_.notify_all();
}

std::shared_ptr<Job> JobQueue::Take() {
  std::unique_lock lock(mutex_);
  auto found = waiting_.end();
  while (!closed_) {
    const Job::Time now = std::chrono::steady_clock::now();
    Job::Time soonest = Job::Time::max();
    found = std::ranges::find_if(waiting_, [&](const auto& entry) {
      const Job& job = *entry.second;
      if (at_work_.contains(job.map)) return false;
      if (job.not_before > now) soonest = std::min(soonest, job.not_before);
      return job.not_before <= now;
    });
    if (found != waiting_.end()) break;
    if (soonest == Job::Time::max()) {
      changed_.wait(lock);
    } else {
      changed_.wait_until(lock, soonest);
    }
  }
  if (closed_) return nullptr;
  std::shared_ptr<Job> job = found->second;
  waiting_.erase(found);
  at_work_.emplace(job->map, job);
  return job;
}

void JobQueue::Done(const Job& job) {
  {
    const std::lock_guard lock(mutex_);
    at_work_.erase(job.map);
    known_.erase({job.map, job.session});
  }
  changed_.notify_all();
}

void JobQueue::PutOff(const std::shared_ptr<Job>& job, std::chrono::milliseconds pause) {
  {
    const std::lock_guard lock(mutex_);
    at_work_.erase(job->map);
    if (closed_ || job->stop == StopReason::kMapDeleted) {
      known_.erase({job->map, job->session});
    } else {
      job->resumed = true;
      job->stop = StopReason::kNone;
      job->not_before = std::chrono::steady_clock::now() + pause;
      waiting_.emplace(OrderOf(*job), job);
    }
  }
  changed_.notify_all();
}

void JobQueue::StopMap(std::string_view map, StopReason reason) {
  std::unique_lock lock(mutex_);
  for (auto entry = waiting_.begin(); entry != waiting_.end();) {
    const Job& job = *entry->second;
    if (job.map != map) {
      ++entry;
      continue;
    }
    known_.erase({job.map, job.session});
    entry = waiting_.erase(entry);
  }
  if (const auto found = at_work_.find(map); found != at_work_.end()) found->second->stop = reason;
  changed_.wait(lock, [&] { return !at_work_.contains(map); });
}

JobQueueStatus JobQueue::Status() const {
  const std::lock_guard lock(mutex_);
  JobQueueStatus status{.waiting = waiting_.size(), .at_work = at_work_.size()};
  const auto now = std::chrono::steady_clock::now();
  for (const auto& [order, job] : waiting_) {
    status.oldest_seconds = std::max(status.oldest_seconds, std::chrono::duration<double>(now - job->pushed).count());
  }
  return status;
}

void JobQueue::Close(StopReason reason) {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    for (const auto& [map, job] : at_work_) job->stop = reason;
  }
  changed_.notify_all();
}

}  // namespace mapkeep
