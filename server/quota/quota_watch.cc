#include "server/quota/quota_watch.h"

#include <chrono>
#include <string>

#include "server/log.h"
#include "storage/map_copy.h"

namespace mapkeep {
namespace {

constexpr std::chrono::seconds kPause{60};
constexpr size_t kPage = 100;

}  // namespace

QuotaWatch::QuotaWatch(const Engine& engine, const SessionStore& sessions, Quotas& quotas)
    : engine_(engine), sessions_(sessions), quotas_(quotas), thread_([this](const std::stop_token& stop) {
        FindAll(stop);
        std::unique_lock lock(mutex_);
        while (!stop.stop_requested()) {
          changed_.wait_for(lock, stop, kPause, [] { return false; });
          LookAgain(stop);
        }
      }) {}

void QuotaWatch::FindAll(const std::stop_token& stop) {
  const auto maps = MapNames(engine_);
  if (!maps.ok()) {
    LogWarning("sessions not counted", {{"why", maps.status().ToString()}});
    return;
  }
  for (const std::string& map : *maps) {
    std::string after;
    do {
      const auto page = sessions_.List(map, after, kPage);
      if (!page.ok()) {
        LogWarning("sessions not counted", {{"map", map}, {"why", page.status().ToString()}});
        break;
      }
      for (const SessionRecord& session : page->sessions) {
        if (!HasEnded(session.state)) quotas_.Note(session);
      }
      after = page->next;
    } while (!after.empty() && !stop.stop_requested());
  }
}

void QuotaWatch::LookAgain(const std::stop_token& stop) {
  for (const auto& [map, id] : quotas_.Known()) {
    if (stop.stop_requested()) return;
    const auto session = sessions_.Find(map, id);
    if (session.ok()) {
      quotas_.Note(*session);
    } else if (absl::IsNotFound(session.status())) {
      quotas_.Forget(map, id);
    }
  }
}

}  // namespace mapkeep
