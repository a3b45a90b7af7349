#include "tests/bench/hardware_counters.h"

#include <linux/perf_event.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace mapkeep {

HardwareCounters::HardwareCounters() {
  constexpr uint64_t kEvents[3] = {PERF_COUNT_HW_CPU_CYCLES, PERF_COUNT_HW_INSTRUCTIONS, PERF_COUNT_HW_CACHE_MISSES};
  for (int i = 0; i < 3; ++i) {
    perf_event_attr attributes{};
    attributes.type = PERF_TYPE_HARDWARE;
    attributes.size = sizeof attributes;
    attributes.config = kEvents[i];
    attributes.inherit = 1;
    attributes.exclude_kernel = 1;
    files_[i] = static_cast<int>(syscall(SYS_perf_event_open, &attributes, 0, -1, -1, 0));
  }
}

HardwareCounters::~HardwareCounters() {
  for (const int file : files_) {
    if (file >= 0) close(file);
  }
}

std::optional<HardwareCounts> HardwareCounters::Now() const {
  uint64_t values[3] = {};
  for (int i = 0; i < 3; ++i) {
    if (files_[i] < 0 || read(files_[i], &values[i], sizeof values[i]) != sizeof values[i]) return std::nullopt;
  }
  return HardwareCounts{values[0], values[1], values[2]};
}

}  // namespace mapkeep
