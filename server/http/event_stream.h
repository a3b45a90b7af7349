#pragma once

#include <cstddef>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>

namespace mapkeep {

/// Server-sent events on their way to one client. What the client is too slow for is not kept: beyond a limit the
/// stream ends, and the client comes back to see the state of then. Thread-safe.
class EventStream {
 public:
  /// `event: name`, `data: data` (one line), `id: id` unless that is empty.
  void Send(std::string_view name, std::string_view data, std::string_view id = {});
  /// What was sent last is the last.
  void End();

  /// Everything that is to be written now; empty for nothing.
  std::string Take();
  /// Nothing more will come, and everything was taken.
  bool ended() const;

  /// `ready` is called whenever Take or ended may give something new; it must not block nor call back. Null: nobody
  /// listens any more.
  void OnReady(std::function<void()> ready);

 private:
  static constexpr size_t kMostPending = 1 << 20;  // bytes

  mutable std::mutex mutex_;
  std::function<void()> ready_;
  std::string pending_;
  bool ended_ = false;
};

}  // namespace mapkeep
