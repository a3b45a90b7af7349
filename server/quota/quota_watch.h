#pragma once

#include <condition_variable>
#include <mutex>
#include <thread>

#include "server/quota/quotas.h"
#include "storage/engine.h"

namespace mapkeep {

/// Keeps `quotas` true in the background: finds the sessions that earlier daemons left under way, and then looks every
/// minute what became of those that are known, for where daemons share a store another one may have ended them.
class QuotaWatch {
 public:
  /// All of it outlives this.
  QuotaWatch(const Engine& engine, const SessionStore& sessions, Quotas& quotas);

 private:
  void FindAll(const std::stop_token& stop);
  void LookAgain(const std::stop_token& stop);

  const Engine& engine_;
  const SessionStore& sessions_;
  Quotas& quotas_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::jthread thread_;
};

}  // namespace mapkeep
