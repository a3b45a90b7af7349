#include "server/pipeline/job_queue.h"

#include <algorithm>

namespace mapkeep {

void JobQueue::Push(std::string map, std::string session, bool resumed, double created) {
  {
    const std::lock_guard lock(mutex_);
    if (closed_ || !known_.emplace(map, session).second) return;
    auto job = std::make_shared<Job>(std::move(map), std::move(session), resumed, created);
    waiting_.emplace(OrderOf(*job), job);
  }
  changed_.notify_all();
}

std::shared_ptr<Job> JobQueue::Take() {
  std::unique_lock lock(mutex_);
  const auto next = [this] {
    return std::ranges::find_if(waiting_, [this](const auto& entry) { return !at_work_.contains(entry.second->map); });
  };
  changed_.wait(lock, [&] { return closed_ || next() != waiting_.end(); });
  if (closed_) return nullptr;
  const auto found = next();
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
