#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/scan.h"
#include "core/registration/aligner.h"
#include "storage/engine.h"

namespace mapkeep {

/// Rolled back: it was committed, and a rollback of the map took it out again.
enum class SessionState : uint8_t { kUploading = 1, kQueued, kRunning, kCommitted, kRefused, kFailed, kRolledBack };

/// Whether a session in this state is over.
constexpr bool HasEnded(SessionState state) { return state >= SessionState::kCommitted; }

struct StageTime {
  std::string stage;
  double seconds = 0;
};

/// What the pipeline found out; see SessionReport in proto/mapkeep/v1/session_service.proto.
struct SessionReport {
  std::vector<WindowResult> windows;
  std::vector<StageTime> stages;
  uint64_t points = 0, points_removed = 0, points_restored = 0;
  uint64_t session_voxels = 0, voxels_kept = 0, static_voxels = 0, blocks_touched = 0;
  uint64_t base_epoch = 0, epoch = 0;
};

struct SessionRecord {
  std::string map;
  std::string id;
  std::string robot;
  SessionState state = SessionState::kUploading;
  bool keep_scans = false;
  std::vector<uint32_t> scan_crc32c;  ///< of every scan: the session's content
  uint32_t durable_scans = 0;         ///< scans [0, durable_scans) are staged; not lowered when they are deleted
  uint64_t payload_bytes = 0;         ///< of those scans, as they were sent
  bool scans_deleted = false;
  double created = 0, ended = 0, start_time = 0;  ///< seconds since 1970 (UTC)
  std::string reason;                             ///< why it was refused or failed
  SessionReport report;
  /// Where the first scan was taken, if anybody said so: x, y, z in the map frame, and yaw (metres, radians).
  std::optional<std::array<double, 4>> initial_pose;
  /// Where GNSS says that it was: x, y, z in the map's CRS, and their covariance row by row.
  std::optional<std::array<double, 12>> gnss;
  bool lacks_map = false;     ///< refused, and the map may just not reach there yet
  uint32_t retries = 0;       ///< times that the daemon has tried it again by itself
  uint64_t staged_bytes = 0;  ///< of scans [0, durable_scans), decoded: 16 bytes a point
  /// Its place in the order of CommitSession: microseconds since 1970 when it was queued, never twice in a map. 0:
  /// none.
  uint64_t turn = 0;
};

/// A scan as it waits for the pipeline, bit for bit: what was uploaded, or what its compressed points decoded to when
/// they came. So a session's result does not depend on the decoder of the day that it is run or replayed on.
struct StagedScan {
  Scan scan;
  Pose pose = Pose::Identity();  ///< T_odometry_sensor
  uint64_t payload_bytes = 0;    ///< that its points took on the wire; counted when it is appended, not stored with it
};

/// The same on its way into the store: the value that it is stored as (scan_codec.h), plain.
struct PlainScan {
  std::string value;
  uint64_t payload_bytes = 0;
};

/// Sessions and their staged scans on an engine. Thread-safe; changes of one session's record are compare-and-set, so
/// that two writers cannot both believe they won (the loser gets ABORTED).
class SessionStore final {
 public:
  /// From so many bytes of points on, a batch of scans is written plain, as large values: whoever sends so fast waits
  /// for the disk and the processor, not for want of space.
  static constexpr size_t kLargeBatchBytes = size_t{3} << 20;

  /// `engine` outlives it.
  explicit SessionStore(Engine& engine, size_t large_batch_bytes = kLargeBatchBytes);

  /// Makes the session in state uploading, or gives the one that exists with the same content. ALREADY_EXISTS, naming
  /// the first difference, if its scans differ. One that was rolled back and whose scans are gone is uploading again.
  absl::StatusOr<SessionRecord> Begin(const SessionRecord& session);
  /// NOT_FOUND.
  absl::StatusOr<SessionRecord> Find(std::string_view map, std::string_view id) const;
  /// By creation time then id, after `after` (an opaque position from the last call, empty: from the first).
  struct Page {
    std::vector<SessionRecord> sessions;
    std::string next;  ///< empty when there is no more
  };
  absl::StatusOr<Page> List(std::string_view map, std::string_view after, size_t limit) const;
  /// Sessions of any map in state queued or running, by their turns: what a starting daemon goes on with.
  absl::StatusOr<std::vector<SessionRecord>> Unfinished() const;
  /// The id of the map's queued or running session whose turn is first, if there is one.
  absl::StatusOr<std::optional<std::string>> FirstUnfinished(std::string_view map) const;
  /// Refused sessions of the map that lack map and have their scans, by their turns.
  absl::StatusOr<std::vector<SessionRecord>> LackingMap(std::string_view map) const;

  /// Stages scans [first, first + scans.size()), durably when it returns, and moves durable_scans. OUT_OF_RANGE if
  /// `first` is not durable_scans, FAILED_PRECONDITION if the session is not uploading.
  absl::Status AppendScans(std::string_view map, std::string_view id, uint32_t first, std::vector<PlainScan> scans);
  /// The same for who has points. INVALID_ARGUMENT, naming the scan, if its intensities do not match them.
  absl::Status AppendScans(std::string_view map, std::string_view id, uint32_t first,
                           std::span<const StagedScan> scans);
  /// One staged scan. DATA_LOSS if it is damaged.
  absl::StatusOr<StagedScan> ReadScan(std::string_view map, std::string_view id, uint32_t index) const;

  /// Writes the record if its stored state is `expected`; ABORTED with the state found otherwise. What the store keeps
  /// itself is not taken from `session`: content, durable_scans, payload_bytes, staged_bytes, scans_deleted, created,
  /// turn. One that becomes queued is given the map's next turn, unless the daemon tries it again by itself (`retries`
  /// grew): then it keeps its own.
  absl::Status Update(const SessionRecord& session, SessionState expected);

  /// Takes a session that was refused, failed or was rolled back back to state queued, without reason and report, and
  /// gives it as it is then, with a new turn. FAILED_PRECONDITION in any other state, and if its scans were deleted:
  /// begin it again, then.
  absl::StatusOr<SessionRecord> Requeue(std::string_view map, std::string_view id);

  /// Aligned poses, one a scan, durable when it returns.
  absl::Status WritePoses(std::string_view map, std::string_view id, std::span<const Pose> poses);
  /// NOT_FOUND before they are written.
  absl::StatusOr<std::vector<Pose>> ReadPoses(std::string_view map, std::string_view id) const;

  /// Deletes the staged scans and marks the record.
  absl::Status DeleteScans(std::string_view map, std::string_view id);
  /// Deletes the session whole. FAILED_PRECONDITION while it is queued or running.
  absl::Status Delete(std::string_view map, std::string_view id);
  /// Deletes every session of a map, in any state.
  absl::Status DeleteAll(std::string_view map);

 private:
  Engine& engine_;
  const size_t large_batch_bytes_;
};

/// `engine` outlives the store.
std::unique_ptr<SessionStore> OpenSessionStore(Engine& engine,
                                               size_t large_batch_bytes = SessionStore::kLargeBatchBytes);

}  // namespace mapkeep
