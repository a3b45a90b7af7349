#include "server/pipeline/replay.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "server/pipeline/run_session.h"
#include "storage/map_rows.h"
#include "storage/rocksdb_engine.h"

namespace mapkeep {
namespace {

constexpr size_t kScansAtOnce = 16;
constexpr size_t kVersionsAtOnce = 1000;

// One replay of one map.
class Replay {
 public:
  Replay(MapStore& maps, SessionStore& sessions, const StageParameters& parameters, const std::string& map,
         Engine& scratch)
      : maps_(maps),
        sessions_(sessions),
        parameters_(parameters),
        map_(map),
        scratch_maps_(OpenMapStore(scratch, {})),
        scratch_sessions_(OpenSessionStore(scratch)),
        scratch_leases_(OpenLeases(scratch)) {}

  absl::StatusOr<ReplayReport> Run(const MapRecord& made, const Progress& progress) {
    if (absl::Status status = scratch_maps_->Create(made).status(); !status.ok()) return status;
    absl::StatusOr<std::vector<MapVersion>> history = History();
    if (!history.ok()) return history.status();
    for (const MapVersion& version : *history) {
      const double done = static_cast<double>(version.commit.epoch) / static_cast<double>(history->size());
      if (progress && !progress(done)) return absl::CancelledError("the replay was stopped");
      const auto again = version.commit.rollback ? RollBack(version.commit) : RunAgain(version.commit);
      if (!again.ok()) return again.status();
      ++report_.commits;
      if (!*again) return report_;
      if (!version.readable) continue;
      if (absl::Status status = CompareTouched(version.commit, **again); !status.ok()) return status;
    }
    if (absl::Status status = CompareHeads(); !status.ok()) return status;
    return report_;
  }

 private:
  // Every epoch but the first, oldest first.
  absl::StatusOr<std::vector<MapVersion>> History() const {
    std::vector<MapVersion> history;
    std::optional<uint64_t> newest;
    while (true) {
      const auto page = maps_.Versions(map_, newest, kVersionsAtOnce);
      if (!page.ok()) return page.status();
      history.insert(history.end(), page->begin(), page->end());
      if (history.back().commit.epoch == 0) break;
      newest = history.back().commit.epoch - 1;
    }
    history.pop_back();
    std::ranges::reverse(history);
    return history;
  }

  using Again = absl::StatusOr<std::optional<CommitRecord>>;

  Again RollBack(const CommitRecord& commit) {
    absl::StatusOr<RollbackOutcome> rolled = scratch_maps_->Rollback(map_, commit.base_epoch);
    if (!rolled.ok()) return rolled.status();
    return std::optional(std::move(rolled->commit));
  }

  // Nothing if the session does not come to the same epoch.
  Again RunAgain(const CommitRecord& commit) {
    if (absl::Status status = Stage(commit.session); !status.ok()) return status;
    Job job(map_, commit.session, false, 0);
    const PipelineStores stores{*scratch_maps_, *scratch_sessions_, *scratch_leases_, feed_, plans_};
    if (absl::Status status = RunSession(stores, parameters_, job, 0, commit.base_epoch); !status.ok()) return status;
    auto found = scratch_maps_->FindCommit(map_, commit.session);
    if (!found.ok()) return found.status();
    if (*found && (*found)->epoch == commit.epoch) return found;
    const auto ended = scratch_sessions_->Find(map_, commit.session);
    Note(absl::StrFormat("epoch %d: session %s was not merged again: %s", commit.epoch, commit.session,
                         ended.ok() ? ended->reason : std::string(ended.status().message())));
    return std::optional<CommitRecord>();
  }

  // The session as it was queued, with its scans.
  absl::Status Stage(const std::string& id) {
    absl::StatusOr<SessionRecord> session = sessions_.Find(map_, id);
    if (absl::IsNotFound(session.status()) || (session.ok() && session->scans_deleted)) {
      return absl::FailedPreconditionError(
          absl::StrCat("the scans of session ", id, " are gone: a replay needs history.keep_scans"));
    }
    if (!session.ok()) return session.status();
    // One that was rolled back and merged again comes twice.
    const absl::Status deleted = scratch_sessions_->Delete(map_, id);
    if (!deleted.ok() && !absl::IsNotFound(deleted)) return deleted;
    SessionRecord copy = *session;
    copy.keep_scans = false;
    copy.report = {};
    copy.reason.clear();
    if (absl::Status status = scratch_sessions_->Begin(copy).status(); !status.ok()) return status;
    const auto count = static_cast<uint32_t>(copy.scan_crc32c.size());
    std::vector<StagedScan> scans;
    for (uint32_t i = 0; i < count; ++i) {
      absl::StatusOr<StagedScan> scan = sessions_.ReadScan(map_, id, i);
      if (!scan.ok()) return scan.status();
      scans.push_back(*std::move(scan));
      if (scans.size() < kScansAtOnce && i + 1 < count) continue;
      const auto first = static_cast<uint32_t>(i + 1 - scans.size());
      if (absl::Status status = scratch_sessions_->AppendScans(map_, id, first, scans); !status.ok()) return status;
      scans.clear();
    }
    copy.state = SessionState::kQueued;
    return scratch_sessions_->Update(copy, SessionState::kUploading);
  }

  absl::Status CompareTouched(const CommitRecord& commit, const CommitRecord& again) {
    std::set<TileKey> tiles(commit.touched_tiles.begin(), commit.touched_tiles.end());
    tiles.insert(again.touched_tiles.begin(), again.touched_tiles.end());
    return Compare(commit.epoch, tiles);
  }

  absl::Status CompareHeads() {
    const auto head = maps_.Open(map_);
    if (!head.ok()) return head.status();
    const auto again = scratch_maps_->Open(map_, (*head)->epoch());
    if (absl::IsNotFound(again.status())) return absl::OkStatus();  // committed since the replay began
    if (!again.ok()) return again.status();
    std::set<TileKey> tiles;
    for (const Snapshot* snapshot : {head->get(), again->get()}) {
      const auto some = snapshot->Tiles(std::nullopt);
      if (!some.ok()) return some.status();
      tiles.insert(some->begin(), some->end());
    }
    return Compare((*head)->epoch(), tiles);
  }

  absl::Status Compare(uint64_t epoch, const std::set<TileKey>& tiles) {
    const auto original = maps_.Open(map_, epoch);
    if (absl::IsFailedPrecondition(original.status())) return absl::OkStatus();  // collected meanwhile
    if (!original.ok()) return original.status();
    const auto again = scratch_maps_->Open(map_, epoch);
    if (!again.ok()) return again.status();
    for (const TileKey tile : tiles) {
      std::set<BlockKey> keys;
      for (const Snapshot* snapshot : {original->get(), again->get()}) {
        const auto some = snapshot->BlocksOf(tile);
        if (!some.ok()) return some.status();
        keys.insert(some->begin(), some->end());
      }
      for (const BlockKey key : keys) {
        const auto a = (*original)->Read(key);
        if (!a.ok()) return a.status();
        const auto b = (*again)->Read(key);
        if (!b.ok()) return b.status();
        ++report_.blocks;
        // Equal blocks have equal bytes: their encoding is a function of their content.
        if (*a != nullptr && *b != nullptr && **a == **b) continue;
        const VoxelIndex at = BlockIndexOf(key);
        Note(absl::StrFormat("epoch %d: block (%d, %d, %d) differs", epoch, at.x, at.y, at.z));
      }
    }
    return absl::OkStatus();
  }

  void Note(std::string difference) {
    ++report_.different;
    if (report_.first_difference.empty()) report_.first_difference = std::move(difference);
  }

  MapStore& maps_;
  SessionStore& sessions_;
  const StageParameters& parameters_;
  const std::string& map_;
  std::unique_ptr<MapStore> scratch_maps_;
  std::unique_ptr<SessionStore> scratch_sessions_;
  std::unique_ptr<Leases> scratch_leases_;
  SessionFeed feed_;
  PlanCache plans_;
  ReplayReport report_;
};

}  // namespace

absl::StatusOr<ReplayReport> ReplayMap(Engine& engine, MapStore& maps, SessionStore& sessions,
                                       const StageParameters& parameters, const std::string& map,
                                       const std::string& directory, const Progress& progress) {
  // As it was made: the origin of now may have come with the first session.
  const auto made = ReadRow(engine, kCatalogue, CatalogueRow(map), DecodeMap);
  if (!made.ok()) return made.status();
  if (!*made) return absl::NotFoundError(absl::StrCat("there is no map ", map));
  const auto scratch = OpenRocksDbEngine(directory);
  if (!scratch.ok()) return scratch.status();
  return Replay(maps, sessions, parameters, map, **scratch).Run((*made)->value, progress);
}

}  // namespace mapkeep
