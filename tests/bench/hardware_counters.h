#pragma once

#include <cstdint>
#include <optional>

namespace mapkeep {

/// What the processor counted, of all threads of the process.
struct HardwareCounts {
  uint64_t cycles = 0, instructions = 0, cache_misses = 0;
};

/// The processor's counters of this process and the threads that it starts after this object was made; nothing where
/// the machine or the kernel does not give them (virtual machines, containers).
class HardwareCounters {
 public:
  HardwareCounters();
  ~HardwareCounters();
  HardwareCounters(const HardwareCounters&) = delete;
  HardwareCounters& operator=(const HardwareCounters&) = delete;

  std::optional<HardwareCounts> Now() const;

 private:
  int files_[3] = {-1, -1, -1};
};

}  // namespace mapkeep
