#include "server/pipeline/session_feed.h"

namespace mapkeep {

SessionFeed::Watcher SessionFeed::Watch(Key session, std::function<void()> changed) {
  const std::lock_guard lock(mutex_);
  watchers_.emplace(++last_, std::pair(std::move(session), std::move(changed)));
  return last_;
}

SessionFeed::Watcher SessionFeed::WatchMap(std::string map, std::function<void(const std::string&)> changed) {
  const std::lock_guard lock(mutex_);
  map_watchers_.emplace(++last_, std::pair(std::move(map), std::move(changed)));
  return last_;
}

void SessionFeed::Unwatch(Watcher watcher) {
  const std::lock_guard lock(mutex_);
  watchers_.erase(watcher);
  map_watchers_.erase(watcher);
}

void SessionFeed::Changed(const Key& session) {
  const std::lock_guard lock(mutex_);
  Tell(session);
}

void SessionFeed::SetProgress(const Key& session, StageProgress progress) {
  const std::lock_guard lock(mutex_);
  StageProgress& known = progress_[session];
  const bool worth_telling = known.stage != progress.stage ||
                             static_cast<int>(100 * known.fraction) != static_cast<int>(100 * progress.fraction);
  known = std::move(progress);
  if (worth_telling) Tell(session);
}

void SessionFeed::ClearProgress(const Key& session) {
  const std::lock_guard lock(mutex_);
  if (progress_.erase(session) != 0) Tell(session);
}

std::optional<StageProgress> SessionFeed::Progress(const Key& session) const {
  const std::lock_guard lock(mutex_);
  const auto found = progress_.find(session);
  return found == progress_.end() ? std::nullopt : std::optional(found->second);
}

void SessionFeed::LookElsewhere() {
  const std::lock_guard lock(mutex_);
  for (const auto& [watcher, entry] : watchers_) {
    if (!progress_.contains(entry.first)) entry.second();
  }
}

void SessionFeed::Close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  for (const auto& [watcher, entry] : watchers_) entry.second();
  for (const auto& [watcher, entry] : map_watchers_) entry.second("");
}

bool SessionFeed::closed() const {
  const std::lock_guard lock(mutex_);
  return closed_;
}

void SessionFeed::Tell(const Key& session) const {
  for (const auto& [watcher, entry] : watchers_) {
    if (entry.first == session) entry.second();
  }
  for (const auto& [watcher, entry] : map_watchers_) {
    if (entry.first == session.first) entry.second(session.second);
  }
}

}  // namespace mapkeep
