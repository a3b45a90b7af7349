#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace mapkeep {

/// Gives memory that the allocator holds and nobody uses back to the system, in the background until it is destroyed:
/// what sessions and uploads let go of lies between what stays, and the allocator by itself gives back only what lies
/// at the end of a heap. Who allocates meanwhile may wait for some milliseconds, so while `busy` it is done seldom.
class SpareMemory {
 public:
  /// `busy` is asked from its own thread.
  explicit SpareMemory(std::function<bool()> busy);

 private:
  void Work(const std::stop_token& stop);

  const std::function<bool()> busy_;
  std::mutex mutex_;
  std::condition_variable_any never_;
  std::jthread thread_;
};

}  // namespace mapkeep
