#include "server/http/event_stream.h"

#include <utility>

namespace mapkeep {

void EventStream::Send(std::string_view name, std::string_view data, std::string_view id) {
  const std::scoped_lock lock(mutex_);
  if (ended_) return;
  if (pending_.size() + data.size() > kMostPending) {
    ended_ = true;
  } else {
    pending_.append("event: ").append(name);
    if (!id.empty()) pending_.append("\nid: ").append(id);
    pending_.append("\ndata: ").append(data).append("\n\n");
  }
  if (ready_) ready_();
}

void EventStream::End() {
  const std::scoped_lock lock(mutex_);
  ended_ = true;
  if (ready_) ready_();
}

std::string EventStream::Take() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(pending_, {});
}

bool EventStream::ended() const {
  const std::scoped_lock lock(mutex_);
  return ended_ && pending_.empty();
}

void EventStream::OnReady(std::function<void()> ready) {
  const std::scoped_lock lock(mutex_);
  ready_ = std::move(ready);
  if (ready_ && (ended_ || !pending_.empty())) ready_();
}

}  // namespace mapkeep
