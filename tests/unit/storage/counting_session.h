#pragma once

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "storage/session_store.h"
#include "tests/unit/storage/counting_map.h"

namespace mapkeep {

/// How far a counting session has been acknowledged.
enum class Reached { kNothing, kStaged, kQueued, kApplied, kCommitted };
inline constexpr int kReachedStates = 5;

inline constexpr uint32_t kCountingScans = 3;
/// For session stores of counting sessions: two scans at once are large values.
inline constexpr size_t kCountingLargeBatch = size_t{2} * 16 * 2000;

/// The scans of a counting session, large enough to lie in files of their own.
inline StagedScan CountingScan(int session) {
  StagedScan scan;
  scan.scan.points.assign(2000, Eigen::Vector3f(1, 2, static_cast<float>(session)));
  return scan;
}

/// Stages a session's scans (one by one or all at once), queues it, commits it and drops its scans: as the server does,
/// from wherever an earlier run was cut off. `fence` is that of its lease. Tells how far it is known to have come.
inline absl::Status RunCountingSession(MapStore& maps, SessionStore& sessions, int number, uint64_t fence,
                                       const std::function<void(Reached)>& reached) {
  const std::string id = std::to_string(number);
  absl::StatusOr<SessionRecord> begun = sessions.Begin({.map = "m", .id = id, .scan_crc32c = {1, 2, 3}});
  if (!begun.ok()) return begun.status();
  SessionRecord record = *std::move(begun);
  const StagedScan scan = CountingScan(number);
  if (record.state == SessionState::kUploading) {
    const uint32_t at_once = number % 2 == 0 ? 1 : kCountingScans;
    for (uint32_t i = record.durable_scans; i < kCountingScans; i += at_once) {
      const std::vector<StagedScan> batch(std::min(at_once, kCountingScans - i), scan);
      if (absl::Status status = sessions.AppendScans("m", id, i, batch); !status.ok()) return status;
    }
    reached(Reached::kStaged);
    record.state = SessionState::kQueued;
    if (absl::Status status = sessions.Update(record, SessionState::kUploading); !status.ok()) return status;
  }
  if (record.state == SessionState::kQueued) {
    reached(Reached::kQueued);
    record.state = SessionState::kRunning;
    if (absl::Status status = sessions.Update(record, SessionState::kQueued); !status.ok()) return status;
  }
  if (record.state == SessionState::kRunning) {
    const auto applied = maps.FindCommit("m", id);
    if (!applied.ok()) return applied.status();
    if (!applied->has_value()) {
      const absl::Status read = sessions.ReadScan("m", id, 2).status();
      // Whoever slept past its lease here finds that another one has ended the session.
      if (fence != 0 && absl::IsNotFound(read)) return absl::AbortedError(read.message());
      if (!read.ok()) return read;
    }
    CommitRequest request = CountingRequest(number);
    request.lease_fence = fence;
    if (absl::Status status = maps.Commit("m", request).status(); !status.ok()) return status;
    reached(Reached::kApplied);
    if (absl::Status status = sessions.DeleteScans("m", id); !status.ok()) return status;
    record.state = SessionState::kCommitted;
    if (absl::Status status = sessions.Update(record, SessionState::kRunning); !status.ok()) return status;
  }
  reached(Reached::kCommitted);
  return absl::OkStatus();
}

/// The sessions that the map says are applied.
inline std::set<int> AppliedSessions(const Engine& engine, uint64_t incarnation) {
  std::set<int> applied;
  EXPECT_DONE(engine.Scan(HeadPartition(incarnation), "applied/", "applied0",
                          [&applied](std::string_view key, std::string_view) {
                            applied.insert(std::stoi(std::string(key.substr(8))));
                            return true;
                          }));
  return applied;
}

/// Whether the store still has what it acknowledged of a session.
inline void ExpectKept(const SessionStore& sessions, int number, Reached reached) {
  const auto record = sessions.Find("m", std::to_string(number));
  ASSERT_DONE(record) << number;
  if (reached >= Reached::kStaged) {
    EXPECT_EQ(record->durable_scans, kCountingScans) << number;
    for (uint32_t i = 0; !record->scans_deleted && i < kCountingScans; ++i) {
      const auto scan = sessions.ReadScan("m", std::to_string(number), i);
      ASSERT_DONE(scan) << number;
      EXPECT_EQ(scan->scan.points, CountingScan(number).scan.points) << number;
    }
  }
  if (reached >= Reached::kQueued) {
    EXPECT_NE(record->state, SessionState::kUploading) << number;
    EXPECT_GT(record->turn, 0U) << number;
  }
  if (reached == Reached::kCommitted) {
    EXPECT_EQ(record->state, SessionState::kCommitted) << number;
  }
}

}  // namespace mapkeep
