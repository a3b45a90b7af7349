#include "server/service_notice.h"

#include <systemd/sd-daemon.h>

#include <chrono>
#include <cstdint>
#include <utility>

namespace mapkeep {

ServiceNotice::ServiceNotice(std::function<bool()> is_alive) {
  sd_notify(0, "READY=1");
  uint64_t microseconds = 0;
  if (sd_watchdog_enabled(0, &microseconds) <= 0) return;
  thread_ = std::jthread([this, is_alive = std::move(is_alive), microseconds](const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
      if (is_alive()) sd_notify(0, "WATCHDOG=1");
      changed_.wait_for(lock, stop, std::chrono::microseconds(microseconds / 2), [] { return false; });
    }
  });
}

void ServiceNotice::Stopping() {
  if (thread_.joinable()) {
    thread_.request_stop();
    thread_.join();
  }
  // The time that stopping may take is the unit's TimeoutStopSec=.
  sd_notify(0, "STOPPING=1");
}

}  // namespace mapkeep
