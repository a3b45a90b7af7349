#include "storage/pause.h"

#include <chrono>
#include <thread>

namespace mapkeep {
namespace {

using Clock = std::chrono::steady_clock;

// Beside others who do not pause (a merge, another program) it keeps an eighth of a processor.
constexpr std::chrono::microseconds kLongest{500};

}  // namespace

void LetOthersRun() {
  thread_local Clock::time_point began = Clock::now();
  if (Clock::now() - began < kLongest) return;
  std::this_thread::yield();
  began = Clock::now();
}

}  // namespace mapkeep
