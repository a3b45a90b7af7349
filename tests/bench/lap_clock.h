#pragma once

#include <chrono>
#include <ctime>

namespace mapkeep {

struct Lap {
  double wall_ms = 0;
  double processor_ms = 0;  ///< of all threads, which a busy machine disturbs less
};

class LapClock {
 public:
  /// Since the last call.
  Lap Next() {
    const auto now = std::chrono::steady_clock::now();
    const double processor = ProcessorTime();
    const Lap lap{std::chrono::duration<double, std::milli>(now - last_).count(), processor - processor_};
    last_ = now;
    processor_ = processor;
    return lap;
  }

 private:
  static double ProcessorTime() {
    timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
  }

  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  double processor_ = ProcessorTime();
};

}  // namespace mapkeep
