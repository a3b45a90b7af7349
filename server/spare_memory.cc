#include "server/spare_memory.h"

#include <malloc.h>

#include <chrono>
#include <cstddef>
#include <utility>

namespace mapkeep {
namespace {

constexpr std::chrono::seconds kPeriod{10};
constexpr int kPeriodsWhileBusy = 12;             // two minutes
constexpr size_t kWorthwhile = size_t{32} << 20;  // bytes; less is needed again soon

}  // namespace

SpareMemory::SpareMemory(std::function<bool()> busy)
    : busy_(std::move(busy)), thread_([this](const std::stop_token& stop) { Work(stop); }) {}

void SpareMemory::Work(const std::stop_token& stop) {
  for (int waited = 1; !stop.stop_requested(); ++waited) {
    {
      std::unique_lock lock(mutex_);
      never_.wait_for(lock, stop, kPeriod, [] { return false; });
    }
    if (stop.stop_requested() || mallinfo2().fordblks < kWorthwhile) continue;
    if (waited < kPeriodsWhileBusy && busy_()) continue;
    malloc_trim(0);
    waited = 0;
  }
}

}  // namespace mapkeep
