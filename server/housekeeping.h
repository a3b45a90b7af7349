#pragma once

#include <absl/status/status.h>

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#include "server/config.h"
#include "storage/collector.h"
#include "storage/engine.h"
#include "storage/session_store.h"

namespace mapkeep {

/// What a collection is told to keep.
GarbageOptions GarbageOptionsOf(const History& history);

/// Looks after the store in the background until it is destroyed: at once, and then every `collect_seconds`, lets
/// sessions' records follow rollbacks and takes away what is not kept. Where several daemons share a
/// store it also looks, every `take_over_seconds`, for jobs that a daemon which died has left.
class Housekeeping final {
 public:
  /// The stores outlive it.
  Housekeeping(Engine& engine, SessionStore& sessions, const History& history,
               std::function<absl::Status()> take_over = {}, int take_over_seconds = 0);

 private:
  void Work(const std::stop_token& stop);

  Engine& engine_;
  SessionStore& sessions_;
  const History history_;
  const std::function<absl::Status()> take_over_;
  const int take_over_seconds_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::jthread thread_;
};

}  // namespace mapkeep
