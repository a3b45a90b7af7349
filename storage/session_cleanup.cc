#include "storage/session_cleanup.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "storage/map_layout.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr size_t kKeysAtOnce = 1000;
constexpr std::string_view kCleanupPrefix = "cleanup/";
constexpr std::string_view kPosesPrefix = "poses/";

absl::Status DeleteScanValues(Engine& engine, const SessionCleanup& cleanup) {
  for (uint32_t first = 0; first < cleanup.scan_count; first += kKeysAtOnce) {
    std::vector<std::string> keys;
    for (uint32_t i = first; i < cleanup.scan_count && keys.size() < kKeysAtOnce; ++i) keys.push_back(ScanKey(i));
    absl::Status deleted = engine.DeleteValues(SessionGroup(cleanup.incarnation), keys);
    if (!deleted.ok()) return deleted;
  }
  return absl::OkStatus();
}

absl::Status DeletePoseValues(Engine& engine, const SessionCleanup& cleanup) {
  const std::string group = SessionGroup(cleanup.incarnation);
  std::vector<std::string> keys;
  absl::Status scanned = engine.ScanValueKeys(group, kPosesPrefix, EndOf(kPosesPrefix), [&keys](std::string_view key) {
    keys.emplace_back(key);
    return true;
  });
  return scanned.ok() ? engine.DeleteValues(group, keys) : scanned;
}

absl::StatusOr<uint64_t> FinishCleanupsOf(Engine& engine, std::string_view map) {
  std::vector<std::string> rows;
  absl::Status scanned = engine.Scan(SessionPartition(map), kCleanupPrefix, EndOf(kCleanupPrefix),
                                     [&rows](std::string_view, std::string_view row) {
                                       rows.emplace_back(row);
                                       return true;
                                     });
  if (!scanned.ok()) return scanned;
  for (const std::string& row : rows) {
    const absl::StatusOr<SessionCleanup> cleanup = DecodeCleanup(row);
    if (!cleanup.ok()) return cleanup.status();
    if (absl::Status status = FinishCleanup(engine, map, *cleanup); !status.ok()) return status;
  }
  return rows.size();
}

/// Forgets a map without sessions. A session made meanwhile changes the row, which then stays; one that was even queued
/// meanwhile changed the newest turn.
absl::Status ForgetIfEmpty(Engine& engine, std::string_view map, const std::string& row) {
  bool empty = true;
  std::optional<std::string> turn;
  absl::Status scanned =
      engine.Scan(SessionPartition(map), "", "", [&](std::string_view key, std::string_view newest_turn) {
        empty = key == kNewestTurnRow;
        if (empty) turn = newest_turn;
        return empty;
      });
  if (!scanned.ok() || !empty) return scanned;
  if (turn) {
    const std::vector<Condition> same = {{std::string(kNewestTurnRow), turn}};
    const std::vector<Mutation> gone = {{std::string(kNewestTurnRow), std::nullopt}};
    const absl::Status dropped = engine.CompareAndSet(SessionPartition(map), same, gone);
    if (!dropped.ok()) return absl::IsAborted(dropped) ? absl::OkStatus() : dropped;
  }
  const std::vector<Condition> conditions = {{SessionMapRow(map), row}};
  const std::vector<Mutation> mutations = {{SessionMapRow(map), std::nullopt}};
  const absl::Status forgotten = engine.CompareAndSet(kSessionMaps, conditions, mutations);
  return absl::IsAborted(forgotten) ? absl::OkStatus() : forgotten;
}

}  // namespace

std::string SessionMapRow(std::string_view map) { return Text("map/", map); }
std::string SessionPartition(std::string_view map) { return Text("sessions/", map); }
std::string SessionRowKey(std::string_view id) { return Text("session/", id); }
std::string ContentRowKey(std::string_view id) { return Text("content/", id); }
std::string SessionGroup(uint64_t incarnation) { return Text("session/", Hex(incarnation)); }
std::string ScanKey(uint32_t index) { return Text(kScanPrefix, absl::Hex(index, absl::kZeroPad8)); }

std::string SessionPosition(const SessionRecord& record) {
  const double microseconds = std::clamp(record.created * 1e6, 0.0, 9e18);
  return Text(Hex(std::isnan(microseconds) ? 0 : static_cast<uint64_t>(microseconds)), "/", record.id);
}

std::string CleanupRowKey(const SessionCleanup& cleanup) {
  return Text(kCleanupPrefix, Hex(cleanup.incarnation), cleanup.scans_only ? "/scans" : "/all");
}

absl::Status FinishCleanup(Engine& engine, std::string_view map, const SessionCleanup& cleanup) {
  if (absl::Status status = DeleteScanValues(engine, cleanup); !status.ok()) return status;
  if (!cleanup.scans_only) {
    if (absl::Status status = DeletePoseValues(engine, cleanup); !status.ok()) return status;
  }
  const std::vector<Mutation> done = {{CleanupRowKey(cleanup), std::nullopt}};
  return engine.Write(SessionPartition(map), done, Durability::kBuffered);
}

absl::StatusOr<uint64_t> FinishCleanups(Engine& engine) {
  const std::string prefix = SessionMapRow("");
  std::vector<std::pair<std::string, std::string>> maps;
  absl::Status scanned =
      engine.Scan(kSessionMaps, prefix, EndOf(prefix), [&](std::string_view key, std::string_view row) {
        maps.emplace_back(key.substr(prefix.size()), row);
        return true;
      });
  if (!scanned.ok()) return scanned;
  uint64_t finished = 0;
  for (const auto& [map, row] : maps) {
    absl::StatusOr<uint64_t> count = FinishCleanupsOf(engine, map);
    if (!count.ok()) return count;
    finished += *count;
    if (absl::Status status = ForgetIfEmpty(engine, map, row); !status.ok()) return status;
  }
  return finished;
}

}  // namespace mapkeep
