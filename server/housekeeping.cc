#include "server/housekeeping.h"

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

#include "server/log.h"
#include "storage/map_copy.h"
#include "storage/rolled_back_sessions.h"

namespace mapkeep {
namespace {

void Settle(Engine& engine, SessionStore& sessions) {
  const auto maps = MapNames(engine);
  if (!maps.ok()) {
    LogWarning("maps cannot be listed", {{"why", maps.status().ToString()}});
    return;
  }
  for (const std::string& map : *maps) {
    const auto settled = SettleSessions(engine, sessions, map);
    if (settled.ok() || absl::IsNotFound(settled.status())) continue;
    LogWarning("sessions not marked", {{"map", map}, {"why", settled.status().ToString()}});
  }
}

void Collect(Engine& engine, const History& history, const std::stop_token& stop) {
  const auto counts =
      CollectGarbage(engine, GarbageOptionsOf(history), [&stop](double) { return !stop.stop_requested(); });
  if (absl::IsCancelled(counts.status())) return;
  if (!counts.ok()) {
    LogWarning("collection broken off", {{"why", counts.status().ToString()}});
  } else if (!(*counts == GarbageCounts())) {
    LogInfo("collected", {{"epochs", counts->epochs},
                          {"values", counts->values},
                          {"attempts", counts->attempts},
                          {"maps", counts->maps},
                          {"sessions", counts->sessions}});
  }
}

}  // namespace

GarbageOptions GarbageOptionsOf(const History& history) {
  return {.keep_epochs = static_cast<uint64_t>(history.keep_epochs),
          .keep_seconds = history.keep_days * 86400,
          .values_per_second = static_cast<double>(history.values_per_second)};
}

Housekeeping::Housekeeping(Engine& engine, SessionStore& sessions, const History& history,
                           std::function<absl::Status()> take_over, int take_over_seconds)
    : engine_(engine),
      sessions_(sessions),
      history_(history),
      take_over_(std::move(take_over)),
      take_over_seconds_(take_over_ ? take_over_seconds : 0),
      thread_([this](const std::stop_token& stop) { Work(stop); }) {}

void Housekeeping::Work(const std::stop_token& stop) {
  Settle(engine_, sessions_);
  int until_collection = 0;
  while (!stop.stop_requested()) {
    if (until_collection <= 0 && history_.collect_seconds > 0) {
      Settle(engine_, sessions_);
      Collect(engine_, history_, stop);
      until_collection = history_.collect_seconds;
    }
    if (take_over_seconds_ > 0) {
      const absl::Status taken = take_over_();
      if (!taken.ok()) LogWarning("jobs left by others not found", {{"why", taken.ToString()}});
    }
    int pause = history_.collect_seconds > 0 ? until_collection : take_over_seconds_;
    if (take_over_seconds_ > 0) pause = std::min(pause, take_over_seconds_);
    if (pause == 0) return;
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, stop, std::chrono::seconds(pause), [] { return false; });
    until_collection -= pause;
  }
}

}  // namespace mapkeep
