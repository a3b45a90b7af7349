#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace mapkeep {

/// What a pool has to do.
struct WorkPoolStatus {
  size_t waiting = 0, at_work = 0;
  uint64_t done = 0;
  double oldest_seconds = 0;  ///< since the next one to be taken was submitted; 0: none waits
};

/// Threads for work that blocks on storage, so that it never holds up the threads that move bytes.
class WorkPool {
 public:
  /// `background`: its threads give way to those that somebody waits for.
  explicit WorkPool(int threads, bool background = false);
  /// Runs what was submitted, then ends the threads.
  ~WorkPool();
  WorkPool(const WorkPool&) = delete;
  WorkPool& operator=(const WorkPool&) = delete;

  /// Runs `work` on one of the threads, in order of submission. Thread-safe.
  void Submit(std::function<void()> work);

  WorkPoolStatus Status() const;

 private:
  void Run();

  struct Task {
    std::function<void()> work;
    std::chrono::steady_clock::time_point submitted;
  };

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Task> waiting_;
  size_t at_work_ = 0;
  uint64_t done_ = 0;
  bool ending_ = false;
  std::vector<std::jthread> threads_;
};

}  // namespace mapkeep
