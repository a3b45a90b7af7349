#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace mapkeep {

/// What systemd wants to know of a service of Type=notify, and its watchdog (WatchdogSec=). Without systemd (no
/// NOTIFY_SOCKET) nothing of this does anything.
class ServiceNotice {
 public:
  /// Ready now. From here on `is_alive` is called twice as often as the watchdog asks for; while it returns true
  /// systemd hears of it. It should go through what could be stuck.
  explicit ServiceNotice(std::function<bool()> is_alive);

  /// Stopping: no longer ready, and no longer watched.
  void Stopping();

 private:
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::jthread thread_;
};

}  // namespace mapkeep
