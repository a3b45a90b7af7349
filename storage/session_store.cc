#include "storage/session_store.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "storage/map_layout.h"
#include "storage/scan_codec.h"
#include "storage/session_change.h"
#include "storage/session_cleanup.h"
#include "storage/session_codec.h"
#include "storage/text.h"

namespace mapkeep {
namespace {

constexpr int kTries = 64;
constexpr uint64_t kPointBytes = 16;
constexpr size_t kPosesAtOnce = 1024;
constexpr size_t kRowsAtOnce = 1000;
constexpr std::string_view kCreatedPrefix = "created/";
constexpr std::string_view kActivePrefix = "active/";
constexpr std::string_view kLackingPrefix = "lacking/";

std::string CreatedRow(const SessionRecord& record) { return Text(kCreatedPrefix, SessionPosition(record)); }
std::string ActiveRow(const SessionRecord& record) { return Text(kActivePrefix, SessionPosition(record)); }
std::string LackingRow(const SessionRecord& record) { return Text(kLackingPrefix, SessionPosition(record)); }

std::string PoseKey(uint64_t poses, size_t chunk) {
  return Text("poses/", Hex(poses), "/", absl::Hex(chunk, absl::kZeroPad8));
}

std::string_view NameOf(SessionState state) {
  switch (state) {
    case SessionState::kUploading:
      return "uploading";
    case SessionState::kQueued:
      return "queued";
    case SessionState::kRunning:
      return "running";
    case SessionState::kCommitted:
      return "committed";
    case SessionState::kRefused:
      return "refused";
    case SessionState::kFailed:
      return "failed";
    case SessionState::kRolledBack:
      return "rolled back";
  }
  return "unknown";
}

bool IsActive(SessionState state) { return state == SessionState::kQueued || state == SessionState::kRunning; }

/// Refused, and to be tried again once there is more of the map.
bool LacksMap(const SessionRecord& record) {
  return record.state == SessionState::kRefused && record.lacks_map && !record.scans_deleted;
}

/// The rows by which an active session and one that lacks map are found.
std::vector<Mutation> Indices(const SessionRecord& record) {
  return {{ActiveRow(record), IsActive(record.state) ? std::optional(EncodeRow(record.turn)) : std::nullopt},
          {LackingRow(record), LacksMap(record) ? std::optional("") : std::nullopt}};
}

absl::Status CompareContent(const SessionRecord& stored, const SessionRecord& given) {
  const auto& a = stored.scan_crc32c;
  const auto& b = given.scan_crc32c;
  if (a.size() != b.size()) {
    return absl::AlreadyExistsError(Text("session ", given.id, " exists with ", a.size(), " scans, not ", b.size()));
  }
  const auto [in_a, in_b] = std::ranges::mismatch(a, b);
  if (in_a == a.end()) return absl::OkStatus();
  return absl::AlreadyExistsError(Text("session ", given.id, " exists with another scan ", in_a - a.begin(),
                                       ": its checksum is ", absl::Hex(*in_a, absl::kZeroPad8), ", not ",
                                       absl::Hex(*in_b, absl::kZeroPad8)));
}

/// Makes the session's map known to those who look for active sessions.
absl::Status RememberMap(Engine& engine, std::string_view map) {
  const std::vector<Mutation> row = {{SessionMapRow(map), EncodeRow(Random64())}};
  return engine.Write(kSessionMaps, row, Durability::kDurable);
}

absl::Status OfScan(uint32_t index, const absl::Status& status) {
  return {status.code(), Text("scan ", index, ": ", FromAbsl(status.message()))};
}

absl::Status PackScans(uint32_t first, std::span<PlainScan> scans) {
  std::vector<absl::Status> packed(scans.size());
  tbb::parallel_for(size_t{0}, scans.size(), [&](size_t i) {
    absl::StatusOr<std::string> value = PackScan(scans[i].value);
    packed[i] = value.status();
    if (value.ok()) scans[i].value = *std::move(value);
  });
  for (size_t i = 0; i < scans.size(); ++i) {
    if (!packed[i].ok()) return OfScan(first + static_cast<uint32_t>(i), packed[i]);
  }
  return absl::OkStatus();
}

/// Of their points in memory.
uint64_t BytesOf(std::span<const PlainScan> scans) {
  uint64_t bytes = 0;
  for (const PlainScan& scan : scans) bytes += kPointBytes * PointsIn(scan.value);
  return bytes;
}

/// Whether scans [first, first + count) are the ones to come next.
absl::Status CheckAppend(const StoredSession& session, uint32_t first, size_t count) {
  const SessionRecord& record = session.record;
  if (record.state != SessionState::kUploading) {
    return absl::FailedPreconditionError(Text("session ", record.id, " is ", NameOf(record.state), ", not uploading"));
  }
  if (first != record.durable_scans) {
    return absl::OutOfRangeError(
        Text("session ", record.id, ": scan ", first, " came where scan ", record.durable_scans, " was expected"));
  }
  if (count > session.scan_count - first) {
    return absl::OutOfRangeError(Text("session ", record.id, ": scan ", session.scan_count, " is beyond its last"));
  }
  return absl::OkStatus();
}

/// Takes a session out of the store; its values go after, named by a cleanup row until they are gone.
absl::Status DeleteSession(Engine& engine, std::string_view map, std::string_view id, bool in_any_state) {
  SessionCleanup cleanup;
  const absl::StatusOr<StoredSession> deleted =
      ChangeSession(engine, map, id, [&](const StoredSession& found) -> absl::StatusOr<Change> {
        if (!in_any_state && IsActive(found.record.state)) {
          return absl::FailedPreconditionError(Text("session ", id, " is ", NameOf(found.record.state)));
        }
        cleanup = {found.incarnation, false, found.scan_count};
        return Change{found,
                      {{ContentRowKey(id), std::nullopt},
                       {CreatedRow(found.record), std::nullopt},
                       {ActiveRow(found.record), std::nullopt},
                       {LackingRow(found.record), std::nullopt},
                       {CleanupRowKey(cleanup), EncodeCleanup(cleanup)}},
                      true};
      });
  if (!deleted.ok()) return deleted.status();
  return FinishCleanup(engine, map, cleanup);
}

/// A session whose scans are gone takes them again. Its values get another name, so that a deletion of the earlier ones
/// that is still under way cannot meet them.
absl::StatusOr<SessionRecord> BeginAgain(Engine& engine, std::string_view map, std::string_view id) {
  SessionCleanup cleanup;
  absl::StatusOr<StoredSession> changed =
      ChangeSession(engine, map, id, [&](const StoredSession& found) -> absl::StatusOr<Change> {
        if (found.record.state != SessionState::kRolledBack || !found.record.scans_deleted) {
          return absl::AbortedError(Text("session ", id, " is ", NameOf(found.record.state)));
        }
        cleanup = {found.incarnation, false, found.scan_count};
        Change change{found, {{CleanupRowKey(cleanup), EncodeCleanup(cleanup)}}};
        StoredSession& next = change.next;
        next.incarnation = Random64();
        next.poses = 0;
        next.pose_count = 0;
        next.record.state = SessionState::kUploading;
        next.record.durable_scans = 0;
        next.record.staged_bytes = 0;
        next.record.payload_bytes = 0;
        next.record.scans_deleted = false;
        next.record.ended = 0;
        next.record.turn = 0;
        next.record.reason.clear();
        next.record.report = {};
        return change;
      });
  if (!changed.ok()) return changed.status();
  if (absl::Status status = FinishCleanup(engine, map, cleanup); !status.ok()) return status;
  return FindWhole(engine, map, id);
}

/// Up to `limit` names (key without the prefix) of rows after `after`.
absl::StatusOr<std::vector<std::string>> NamesAfter(const Engine& engine, std::string_view map, std::string_view prefix,
                                                    std::string_view after, size_t limit) {
  std::vector<std::string> names;
  if (limit == 0) return names;
  const std::string begin = Text(prefix, after) + (after.empty() ? "" : std::string(1, '\0'));
  const absl::Status scanned =
      engine.Scan(SessionPartition(map), begin, EndOf(prefix), [&](std::string_view key, std::string_view) {
        names.emplace_back(key.substr(prefix.size()));
        return names.size() < limit;
      });
  if (!scanned.ok()) return scanned;
  return names;
}

/// The id in a position: what follows the time.
std::string_view IdIn(std::string_view position) { return position.substr(position.find('/') + 1); }

}  // namespace

std::unique_ptr<SessionStore> OpenSessionStore(Engine& engine, size_t large_batch_bytes) {
  return std::make_unique<SessionStore>(engine, large_batch_bytes);
}

SessionStore::SessionStore(Engine& engine, size_t large_batch_bytes)
    : engine_(engine), large_batch_bytes_(large_batch_bytes) {}

absl::StatusOr<SessionRecord> SessionStore::Begin(const SessionRecord& session) {
  for (int i = 0; i < kTries; ++i) {
    absl::StatusOr<SessionRecord> existing = FindWhole(engine_, session.map, session.id);
    if (existing.ok()) {
      if (absl::Status status = CompareContent(*existing, session); !status.ok()) return status;
      if (existing->state != SessionState::kRolledBack || !existing->scans_deleted) return existing;
      return BeginAgain(engine_, session.map, session.id);
    }
    if (!absl::IsNotFound(existing.status())) return existing;
    StoredSession stored{session, Random64(), static_cast<uint32_t>(session.scan_crc32c.size())};
    stored.record.state = SessionState::kUploading;
    stored.record.durable_scans = 0;
    stored.record.staged_bytes = 0;
    stored.record.payload_bytes = 0;
    stored.record.scans_deleted = false;
    const std::vector<Condition> conditions = {{SessionRowKey(session.id), std::nullopt}};
    const std::vector<Mutation> mutations = {{SessionRowKey(session.id), EncodeSession(stored)},
                                             {ContentRowKey(session.id), EncodeContent(session.scan_crc32c)},
                                             {CreatedRow(session), std::string()}};
    const absl::Status made = engine_.CompareAndSet(SessionPartition(session.map), conditions, mutations);
    if (made.ok()) {
      if (absl::Status status = RememberMap(engine_, session.map); !status.ok()) return status;
      return stored.record;
    }
    if (!absl::IsAborted(made) && !absl::IsUnknown(made) && !absl::IsDeadlineExceeded(made)) return made;
  }
  return absl::UnavailableError(Text("session ", session.id, " is made and deleted by others all the time"));
}

absl::StatusOr<SessionRecord> SessionStore::Find(std::string_view map, std::string_view id) const {
  return FindWhole(engine_, map, id);
}

absl::StatusOr<SessionStore::Page> SessionStore::List(std::string_view map, std::string_view after,
                                                      size_t limit) const {
  // One more than asked for tells whether there is another page.
  absl::StatusOr<std::vector<std::string>> positions = NamesAfter(engine_, map, kCreatedPrefix, after, limit + 1);
  if (!positions.ok()) return positions.status();
  Page page;
  if (positions->size() > limit) {
    positions->pop_back();
    if (!positions->empty()) page.next = positions->back();
  }
  for (const std::string& position : *positions) {
    absl::StatusOr<SessionRecord> session = FindWhole(engine_, map, IdIn(position));
    if (absl::IsNotFound(session.status())) continue;  // deleted since
    if (!session.ok()) return session.status();
    page.sessions.push_back(*std::move(session));
  }
  return page;
}

absl::StatusOr<std::vector<SessionRecord>> SessionStore::Unfinished() const {
  const std::string prefix = SessionMapRow("");
  std::vector<std::string> maps;
  const absl::Status scanned =
      engine_.Scan(kSessionMaps, prefix, EndOf(prefix), [&maps, &prefix](std::string_view key, std::string_view) {
        maps.emplace_back(key.substr(prefix.size()));
        return true;
      });
  if (!scanned.ok()) return scanned;
  std::vector<SessionRecord> sessions;
  for (const std::string& map : maps) {
    const absl::StatusOr<std::vector<std::string>> positions =
        NamesAfter(engine_, map, kActivePrefix, "", std::numeric_limits<size_t>::max());
    if (!positions.ok()) return positions.status();
    for (const std::string& position : *positions) {
      absl::StatusOr<SessionRecord> session = FindWhole(engine_, map, IdIn(position));
      if (absl::IsNotFound(session.status())) continue;
      if (!session.ok()) return session.status();
      if (IsActive(session->state)) sessions.push_back(*std::move(session));
    }
  }
  std::ranges::stable_sort(sessions, {}, &SessionRecord::turn);
  return sessions;
}

absl::StatusOr<std::optional<std::string>> SessionStore::FirstUnfinished(std::string_view map) const {
  std::optional<std::string> first;
  uint64_t lowest = std::numeric_limits<uint64_t>::max();
  absl::Status decoded;
  const absl::Status scanned = engine_.Scan(
      SessionPartition(map), kActivePrefix, EndOf(kActivePrefix), [&](std::string_view key, std::string_view row) {
        // Rows of programs that knew no turns are empty: their sessions go first.
        const absl::StatusOr<uint64_t> turn = row.empty() ? absl::StatusOr<uint64_t>(0) : DecodeNumber(row);
        decoded = turn.status();
        if (!decoded.ok()) return false;
        if (*turn < lowest) {
          lowest = *turn;
          first = IdIn(key.substr(kActivePrefix.size()));
        }
        return true;
      });
  if (!scanned.ok()) return scanned;
  if (!decoded.ok()) return decoded;
  return first;
}

absl::StatusOr<std::vector<SessionRecord>> SessionStore::LackingMap(std::string_view map) const {
  const absl::StatusOr<std::vector<std::string>> positions =
      NamesAfter(engine_, map, kLackingPrefix, "", std::numeric_limits<size_t>::max());
  if (!positions.ok()) return positions.status();
  std::vector<SessionRecord> sessions;
  for (const std::string& position : *positions) {
    absl::StatusOr<SessionRecord> session = FindWhole(engine_, map, IdIn(position));
    if (absl::IsNotFound(session.status())) continue;
    if (!session.ok()) return session.status();
    if (LacksMap(*session)) sessions.push_back(*std::move(session));
  }
  std::ranges::stable_sort(sessions, {}, &SessionRecord::turn);
  return sessions;
}

absl::Status SessionStore::AppendScans(std::string_view map, std::string_view id, uint32_t first,
                                       std::span<const StagedScan> scans) {
  std::vector<PlainScan> plain;
  for (const StagedScan& scan : scans) {
    absl::StatusOr<std::string> value = EncodeScan(scan, ScanForm::kPlain);
    if (!value.ok()) return OfScan(first + static_cast<uint32_t>(plain.size()), value.status());
    plain.push_back({*std::move(value), scan.payload_bytes});
  }
  return AppendScans(map, id, first, std::move(plain));
}

absl::Status SessionStore::AppendScans(std::string_view map, std::string_view id, uint32_t first,
                                       std::vector<PlainScan> scans) {
  const absl::StatusOr<StoredRow<StoredSession>> found = FindStored(engine_, map, id);
  if (!found.ok()) return found.status();
  if (absl::Status status = CheckAppend(found->value, first, scans.size()); !status.ok()) return status;
  if (scans.empty()) return absl::OkStatus();
  const uint64_t bytes = BytesOf(scans);
  const bool large = bytes >= large_batch_bytes_;
  if (!large) {
    if (absl::Status status = PackScans(first, scans); !status.ok()) return status;
  }
  std::vector<ImmutableValue> values;
  uint64_t payload_bytes = 0;
  for (PlainScan& scan : scans) {
    values.push_back({ScanKey(first + static_cast<uint32_t>(values.size())), std::move(scan.value)});
    payload_bytes += scan.payload_bytes;
  }
  const uint64_t incarnation = found->value.incarnation;
  const std::string group = SessionGroup(incarnation);
  const absl::Status put = large ? engine_.PutLargeValues(group, values) : engine_.PutValues(group, values);
  if (!put.ok()) return put;
  const absl::StatusOr<StoredSession> changed =
      ChangeSession(engine_, map, id, [&](const StoredSession& now) -> absl::StatusOr<Change> {
        if (now.incarnation != incarnation) return NoSession(map, id);
        if (absl::Status status = CheckAppend(now, first, values.size()); !status.ok()) return status;
        Change change{now};
        change.next.record.durable_scans = first + static_cast<uint32_t>(values.size());
        change.next.record.staged_bytes += bytes;
        change.next.record.payload_bytes += payload_bytes;
        return change;
      });
  if (!absl::IsNotFound(changed.status())) return changed.status();
  // Deleted while these were on their way: its cleanup may have missed them.
  std::vector<std::string> keys;
  for (const ImmutableValue& value : values) keys.push_back(value.key);
  if (absl::Status status = engine_.DeleteValues(group, keys); !status.ok()) return status;
  return changed.status();
}

absl::StatusOr<StagedScan> SessionStore::ReadScan(std::string_view map, std::string_view id, uint32_t index) const {
  const absl::StatusOr<StoredRow<StoredSession>> session = FindStored(engine_, map, id);
  if (!session.ok()) return session.status();
  const auto where = [&] { return Text("session ", id, " of map ", map, ", scan ", index); };
  const SessionRecord& record = session->value.record;
  if (index >= record.durable_scans || record.scans_deleted) {
    return absl::NotFoundError(Text(where(), record.scans_deleted ? ": deleted" : ": not uploaded yet"));
  }
  const absl::StatusOr<std::string> value = engine_.GetValue(SessionGroup(session->value.incarnation), ScanKey(index));
  if (absl::IsNotFound(value.status())) return absl::DataLossError(Text(where(), ": its value is missing"));
  if (!value.ok()) return value.status();
  absl::StatusOr<StagedScan> scan = DecodeScan(*value);
  if (!scan.ok()) return absl::DataLossError(Text(where(), ": ", FromAbsl(scan.status().message())));
  return scan;
}

absl::Status SessionStore::Update(const SessionRecord& session, SessionState expected) {
  if (IsActive(session.state)) {
    const absl::StatusOr<std::optional<std::string>> known = engine_.Get(kSessionMaps, SessionMapRow(session.map));
    if (!known.ok()) return known.status();
    if (!*known) {
      if (absl::Status status = RememberMap(engine_, session.map); !status.ok()) return status;
    }
  }
  return ChangeSession(engine_, session.map, session.id,
                       [&](const StoredSession& found) -> absl::StatusOr<Change> {
                         if (found.record.state != expected) {
                           return absl::AbortedError(Text("session ", session.id, " is ", NameOf(found.record.state),
                                                          ", not ", NameOf(expected)));
                         }
                         Change change{found};
                         SessionRecord& next = change.next.record;
                         next.robot = session.robot;
                         next.state = session.state;
                         next.keep_scans = session.keep_scans;
                         next.ended = session.ended;
                         next.start_time = session.start_time;
                         next.reason = session.reason;
                         next.report = session.report;
                         next.initial_pose = session.initial_pose;
                         next.lacks_map = session.lacks_map;
                         next.retries = session.retries;
                         const bool by_itself = session.retries > found.record.retries;
                         const bool queued = IsActive(next.state) && !IsActive(expected) && !by_itself;
                         if (queued || (IsActive(next.state) && next.turn == 0)) {
                           const absl::Status taken = TakeTurn(engine_, session.map, change);
                           if (!taken.ok()) return taken;
                         }
                         for (Mutation& row : Indices(next)) change.beside.push_back(std::move(row));
                         return change;
                       })
      .status();
}

absl::StatusOr<SessionRecord> SessionStore::Requeue(std::string_view map, std::string_view id) {
  if (absl::Status status = RememberMap(engine_, map); !status.ok()) return status;
  const absl::StatusOr<StoredSession> changed =
      ChangeSession(engine_, map, id, [&](const StoredSession& found) -> absl::StatusOr<Change> {
        const SessionState state = found.record.state;
        if (state != SessionState::kRefused && state != SessionState::kFailed && state != SessionState::kRolledBack) {
          return absl::FailedPreconditionError(Text("session ", id, " is ", NameOf(state), ": nothing to try again"));
        }
        if (found.record.scans_deleted) {
          return absl::FailedPreconditionError(Text("session ", id, ": its scans were deleted, upload it again"));
        }
        Change change{found};
        SessionRecord& next = change.next.record;
        next.state = SessionState::kQueued;
        next.ended = 0;
        next.reason.clear();
        next.report = {};
        if (absl::Status status = TakeTurn(engine_, map, change); !status.ok()) return status;
        for (Mutation& row : Indices(next)) change.beside.push_back(std::move(row));
        return change;
      });
  if (!changed.ok()) return changed.status();
  return FindWhole(engine_, map, id);
}

absl::Status SessionStore::WritePoses(std::string_view map, std::string_view id, std::span<const Pose> poses) {
  const absl::StatusOr<StoredRow<StoredSession>> found = FindStored(engine_, map, id);
  if (!found.ok()) return found.status();
  const uint64_t incarnation = found->value.incarnation;
  const uint64_t name = Random64();
  std::vector<ImmutableValue> values;
  for (size_t at = 0; at < poses.size(); at += kPosesAtOnce) {
    values.push_back({PoseKey(name, values.size()),
                      EncodePoses(poses.subspan(at).first(std::min(kPosesAtOnce, poses.size() - at)))});
  }
  if (absl::Status status = engine_.PutValues(SessionGroup(incarnation), values); !status.ok()) return status;
  StoredSession before;
  const absl::StatusOr<StoredSession> changed =
      ChangeSession(engine_, map, id, [&](const StoredSession& now) -> absl::StatusOr<Change> {
        if (now.incarnation != incarnation) return NoSession(map, id);
        before = now;
        Change change{now};
        change.next.poses = name;
        change.next.pose_count = static_cast<uint32_t>(poses.size());
        return change;
      });
  // What is no longer named goes: the poses of before, or these.
  const bool gone = absl::IsNotFound(changed.status());
  if (!changed.ok() && !gone) return changed.status();
  std::vector<std::string> keys;
  const size_t chunks = ((gone ? poses.size() : before.pose_count) + kPosesAtOnce - 1) / kPosesAtOnce;
  for (size_t i = 0; i < chunks; ++i) keys.push_back(PoseKey(gone ? name : before.poses, i));
  if (absl::Status status = engine_.DeleteValues(SessionGroup(incarnation), keys); !status.ok()) return status;
  return changed.status();
}

absl::StatusOr<std::vector<Pose>> SessionStore::ReadPoses(std::string_view map, std::string_view id) const {
  const absl::StatusOr<StoredRow<StoredSession>> session = FindStored(engine_, map, id);
  if (!session.ok()) return session.status();
  const StoredSession& stored = session->value;
  if (stored.poses == 0) return absl::NotFoundError(Text("session ", id, " has no aligned poses yet"));
  std::vector<Pose> poses;
  for (size_t chunk = 0; poses.size() < stored.pose_count; ++chunk) {
    const absl::StatusOr<std::string> value =
        engine_.GetValue(SessionGroup(stored.incarnation), PoseKey(stored.poses, chunk));
    if (absl::IsNotFound(value.status())) {
      return absl::DataLossError(Text("session ", id, ": aligned poses from ", poses.size(), " are missing"));
    }
    if (!value.ok()) return value.status();
    const absl::StatusOr<std::vector<Pose>> some = DecodePoses(*value);
    if (!some.ok()) return some.status();
    if (some->empty()) return absl::DataLossError(Text("session ", id, ": a chunk of aligned poses is empty"));
    poses.insert(poses.end(), some->begin(), some->end());
  }
  return poses;
}

absl::Status SessionStore::DeleteScans(std::string_view map, std::string_view id) {
  SessionCleanup cleanup;
  const absl::StatusOr<StoredSession> marked =
      ChangeSession(engine_, map, id, [&](const StoredSession& found) -> absl::StatusOr<Change> {
        if (found.record.state == SessionState::kUploading) {
          return absl::FailedPreconditionError(Text("session ", id, " is uploading"));
        }
        cleanup = {found.incarnation, true, found.scan_count};
        Change change{found, {{CleanupRowKey(cleanup), EncodeCleanup(cleanup)}}};
        change.next.record.scans_deleted = true;
        change.beside.push_back({LackingRow(found.record), std::nullopt});
        return change;
      });
  return marked.ok() ? FinishCleanup(engine_, map, cleanup) : marked.status();
}

absl::Status SessionStore::Delete(std::string_view map, std::string_view id) {
  return DeleteSession(engine_, map, id, false);
}

absl::Status SessionStore::DeleteAll(std::string_view map) {
  while (true) {
    const absl::StatusOr<std::vector<std::string>> positions =
        NamesAfter(engine_, map, kCreatedPrefix, "", kRowsAtOnce);
    if (!positions.ok()) return positions.status();
    if (positions->empty()) return absl::OkStatus();
    for (const std::string& position : *positions) {
      absl::Status deleted = DeleteSession(engine_, map, IdIn(position), true);
      if (!deleted.ok() && !absl::IsNotFound(deleted)) return deleted;
    }
  }
}

}  // namespace mapkeep
