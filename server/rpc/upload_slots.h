#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace mapkeep {

/// The uploads under way, at most one a session. Thread-safe.
class UploadSlots {
 public:
  using Key = std::pair<std::string, std::string>;  ///< map and session

  /// False if the session has an upload under way. `stop` is called when the daemon ends; it must not block nor call
  /// this.
  bool Take(const Key& session, std::function<void()> stop) {
    const std::lock_guard lock(mutex_);
    if (!taken_.emplace(session, stop).second) return false;
    if (closed_) stop();
    return true;
  }

  /// `stop` is not running and will not be called once this returns.
  void Free(const Key& session) {
    const std::lock_guard lock(mutex_);
    taken_.erase(session);
  }

  size_t size() const {
    const std::lock_guard lock(mutex_);
    return taken_.size();
  }

  /// Bytes of messages that came in (or, negative, were taken on) and are not decoded yet, of all uploads.
  void AddReceived(int64_t bytes) { received_ += bytes; }
  int64_t received() const { return received_; }

  /// Bytes of messages and scans that came in (or, negative, went) and are not durable yet, of all uploads.
  void AddPending(int64_t bytes) { pending_ += bytes; }
  int64_t pending() const { return pending_; }

  /// The daemon ends: stops every upload, also those that come later.
  void Close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    for (const auto& [session, stop] : taken_) stop();
  }

 private:
  mutable std::mutex mutex_;
  bool closed_ = false;
  std::atomic<int64_t> received_ = 0, pending_ = 0;
  std::map<Key, std::function<void()>> taken_;
};

}  // namespace mapkeep
