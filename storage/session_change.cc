#include "storage/session_change.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "storage/clock.h"
#include "storage/session_cleanup.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr int kTries = 64;

}  // namespace

absl::Status NoSession(std::string_view map, std::string_view id) {
  return absl::NotFoundError(Text("map ", map, " has no session ", id));
}

absl::StatusOr<StoredRow<StoredSession>> FindStored(const Engine& engine, std::string_view map, std::string_view id) {
  auto row = ReadRow(engine, SessionPartition(map), SessionRowKey(id), DecodeSession);
  if (!row.ok()) return row.status();
  if (!*row) return NoSession(map, id);
  (*row)->value.record.map = map;
  return **std::move(row);
}

absl::StatusOr<SessionRecord> FindWhole(const Engine& engine, std::string_view map, std::string_view id) {
  absl::StatusOr<StoredRow<StoredSession>> stored = FindStored(engine, map, id);
  if (!stored.ok()) return stored.status();
  auto content = ReadRow(engine, SessionPartition(map), ContentRowKey(id), DecodeContent);
  if (!content.ok()) return content.status();
  if (!*content) return NoSession(map, id);  // deleted since
  stored->value.record.scan_crc32c = std::move((*content)->value);
  return std::move(stored->value.record);
}

absl::StatusOr<StoredSession> ChangeSession(Engine& engine, std::string_view map, std::string_view id,
                                            const ChangeMaker& make) {
  absl::Status last;
  std::string wanted;
  std::optional<StoredSession> deleted;  // by a try that went unanswered
  for (int i = 0; i < kTries; ++i) {
    const absl::StatusOr<StoredRow<StoredSession>> found = FindStored(engine, map, id);
    if (absl::IsNotFound(found.status()) && deleted) return *std::move(deleted);
    if (!found.ok()) return found.status();
    if (found->bytes == wanted) return found->value;  // an unanswered try came through
    absl::StatusOr<Change> change = make(found->value);
    if (!change.ok()) return change.status();
    change->next.revision = found->value.revision + 1;
    wanted = EncodeSession(change->next);
    std::vector<Mutation> mutations = std::move(change->beside);
    mutations.push_back({SessionRowKey(id), change->deletes ? std::nullopt : std::optional(wanted)});
    std::vector<Condition> conditions = std::move(change->required);
    conditions.push_back({SessionRowKey(id), found->bytes});
    last = engine.CompareAndSet(SessionPartition(map), conditions, mutations);
    if (last.ok()) return change->next;
    if (change->deletes && !absl::IsAborted(last)) deleted = change->next;
    if (!absl::IsAborted(last) && !absl::IsUnknown(last) && !absl::IsDeadlineExceeded(last)) return last;
  }
  return last;
}

absl::Status TakeTurn(const Engine& engine, std::string_view map, Change& change) {
  const auto newest = ReadRow(engine, SessionPartition(map), kNewestTurnRow, DecodeNumber);
  if (!newest.ok()) return newest.status();
  const auto now = static_cast<uint64_t>(std::max(0.0, SystemSeconds() * 1e6));
  const uint64_t turn = std::max(now, *newest ? (*newest)->value + 1 : 1);
  change.next.record.turn = turn;
  change.required.push_back({std::string(kNewestTurnRow), BytesOf(*newest)});
  change.beside.push_back({std::string(kNewestTurnRow), EncodeRow(turn)});
  return absl::OkStatus();
}

}  // namespace mapkeep
