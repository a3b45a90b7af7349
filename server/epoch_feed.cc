#include "server/epoch_feed.h"

#include <absl/container/flat_hash_set.h>

#include <utility>
#include <vector>

namespace mapkeep {

EpochFeed::EpochFeed(const MapStore& maps, std::chrono::milliseconds period)
    : maps_(maps), period_(period), thread_([this] { Run(); }) {}

EpochFeed::~EpochFeed() { Close(); }

EpochFeed::Watcher EpochFeed::Watch(std::string map, std::function<void()> changed) {
  const std::lock_guard lock(mutex_);
  watchers_.emplace(++last_, Entry{std::move(map), std::move(changed)});
  return last_;
}

void EpochFeed::Unwatch(Watcher watcher) {
  const std::lock_guard lock(mutex_);
  watchers_.erase(watcher);
}

void EpochFeed::Close() {
  const std::lock_guard lock(mutex_);
  if (std::exchange(closed_, true)) return;
  ending_.notify_all();
  for (const auto& [watcher, entry] : watchers_) entry.changed();
}

bool EpochFeed::closed() const {
  const std::lock_guard lock(mutex_);
  return closed_;
}

void EpochFeed::Run() {
  std::unique_lock lock(mutex_);
  while (!closed_) {
    absl::flat_hash_set<std::string> watched;
    for (const auto& [watcher, entry] : watchers_) watched.insert(entry.map);
    absl::erase_if(seen_, [&watched](const auto& seen) { return !watched.contains(seen.first); });
    lock.unlock();
    for (const std::string& map : watched) Look(map);
    lock.lock();
    ending_.wait_for(lock, period_, [this] { return closed_; });
  }
}

void EpochFeed::Look(const std::string& map) {
  const absl::StatusOr<MapHead> found = maps_.Head(map);
  // A store that does not answer is asked again; those who watch find out by themselves when they read.
  if (!found.ok() && !absl::IsNotFound(found.status())) return;
  const MapHead head = found.ok() ? *found : MapHead();
  const std::lock_guard lock(mutex_);
  const auto [seen, is_new] = seen_.try_emplace(map, head);
  // The first look tells, too: between a watcher's own look and this one there may have been a commit.
  if (!is_new && seen->second == head) return;
  seen->second = head;
  for (const auto& [watcher, entry] : watchers_) {
    if (entry.map == map) entry.changed();
  }
}

}  // namespace mapkeep
