#include "storage/rolled_back_sessions.h"

#include <string>
#include <utility>
#include <vector>

#include "storage/map_history.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

/// Whether the record was changed. States that a run of the session is responsible for are left to it: it looks for the
/// commit first.
absl::StatusOr<bool> Settle(const Engine& engine, uint64_t incarnation, SessionStore& sessions, std::string_view map,
                            std::string_view id) {
  absl::StatusOr<SessionRecord> session = sessions.Find(map, id);
  if (absl::IsNotFound(session.status())) return false;
  if (!session.ok()) return session.status();
  const auto applied = ReadRow(engine, HeadPartition(incarnation), AppliedRowKey(id), DecodeApplied);
  if (!applied.ok()) return applied.status();
  const SessionState before = session->state;
  if (before != SessionState::kCommitted && before != SessionState::kRolledBack) return false;
  if (*applied) {
    if (before == SessionState::kCommitted && session->report.epoch == (*applied)->value.epoch) return false;
    session->state = SessionState::kCommitted;
    session->report.epoch = (*applied)->value.epoch;
    session->reason.clear();
  } else {
    if (before == SessionState::kRolledBack) return false;
    session->state = SessionState::kRolledBack;
    session->reason = Text("the map was rolled back to before epoch ", session->report.epoch);
  }
  const absl::Status updated = sessions.Update(*session, before);
  if (absl::IsAborted(updated)) return false;  // somebody is at work on it
  if (!updated.ok()) return updated;
  return true;
}

}  // namespace

absl::StatusOr<uint64_t> SettleSessions(Engine& engine, SessionStore& sessions, std::string_view map) {
  const absl::StatusOr<uint64_t> incarnation = FindIncarnation(engine, map);
  if (!incarnation.ok()) return incarnation.status();
  const std::string partition = HeadPartition(*incarnation);
  std::vector<std::pair<std::string, std::string>> rows;
  const absl::Status scanned = engine.Scan(partition, kUnsettledPrefix, EndOf(kUnsettledPrefix),
                                           [&rows](std::string_view key, std::string_view bytes) {
                                             rows.emplace_back(key, bytes);
                                             return true;
                                           });
  if (!scanned.ok()) return scanned;
  uint64_t changed = 0;
  for (const auto& [key, bytes] : rows) {
    const absl::StatusOr<bool> settled =
        Settle(engine, *incarnation, sessions, map, std::string_view(key).substr(kUnsettledPrefix.size()));
    if (!settled.ok()) return settled.status();
    changed += *settled ? 1 : 0;
    // A rollback that came meanwhile wrote the row anew: it stays, for the next time.
    const std::vector<Condition> conditions = {{key, bytes}};
    const std::vector<Mutation> done = {{key, std::nullopt}};
    const absl::Status dropped = engine.CompareAndSet(partition, conditions, done);
    if (!dropped.ok() && !absl::IsAborted(dropped)) return dropped;
  }
  return changed;
}

}  // namespace mapkeep
