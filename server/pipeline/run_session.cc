#include "server/pipeline/run_session.h"

#include <absl/strings/str_cat.h>

#include <chrono>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "core/dor/pose_refinement.h"
#include "core/registration/session_search.h"
#include "server/log.h"
#include "server/pipeline/stages.h"
#include "storage/clock.h"

namespace mapkeep {
namespace {

constexpr double kMinutesBetween1970And2000 = 15778080;  // 946,684,800 s

// The reasons that lie in the session; everything else lies in the server.
bool IsRefusal(const absl::Status& status) { return absl::IsInvalidArgument(status) || absl::IsOutOfRange(status); }

// What passes: a full disk, a cluster out of reach, an operation without an answer. Nobody's session ends over that.
bool Passes(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsResourceExhausted(status) || absl::IsUnknown(status) ||
         absl::IsDeadlineExceeded(status);
}

// One run of one session.
class SessionRun {
 public:
  SessionRun(const PipelineStores& stores, const StageParameters& parameters, Job& job, uint64_t fence,
             std::optional<uint64_t> base_epoch, const std::function<void()>& merged)
      : stores_(stores), parameters_(parameters), job_(job), fence_(fence), base_epoch_(base_epoch), merged_(merged) {}

  absl::Status Run() {
    absl::StatusOr<SessionRecord> record = stores_.sessions.Find(job_.map, job_.session);
    if (!record.ok()) return record.status();
    record_ = *std::move(record);
    if (HasEnded(record_.state)) {  // by another daemon
      TellChanged();
      return absl::OkStatus();
    }
    const auto applied = stores_.maps.FindCommit(job_.map, job_.session);
    if (!applied.ok()) return applied.status();
    if (applied->has_value()) return Conclude(**applied);

    const absl::Status outcome = Work();
    if (outcome.ok() || absl::IsCancelled(outcome) || absl::IsAborted(outcome) || Passes(outcome)) return outcome;
    return End(IsRefusal(outcome) ? SessionState::kRefused : SessionState::kFailed, std::string(outcome.message()));
  }

 private:
  absl::Status Work() {
    const SessionState before = record_.state;
    record_.state = SessionState::kRunning;
    record_.report = {};
    if (absl::Status status = Save(before); !status.ok()) return status;
    auto base = stores_.maps.Open(job_.map, base_epoch_);
    if (!base.ok()) return base.status();
    base_ = *std::move(base);
    record_.report.base_epoch = base_->epoch();
    if (absl::Status status = Align(); !status.ok()) return status;
    auto removal = Clean();
    if (!removal.ok()) return removal.status();
    LabelCounts labels;
    auto session_map = Stage<SessionMap>("merge", [&](const Progress& progress) {
      return SummariseSession(scans_, poses_, *removal, MinutesSince2000(record_.start_time), parameters_.session_map,
                              progress, &labels);
    });
    if (!session_map.ok()) return session_map.status();
    record_.report.points_removed = labels.removed;
    record_.report.points_restored = labels.restored;
    record_.report.session_voxels = session_map->voxels.size();
    if (absl::Status status = stores_.sessions.WritePoses(job_.map, job_.session, poses_); !status.ok()) return status;
    auto commit =
        Stage<CommitRecord>("commit", [&](const Progress& progress) { return Commit(*session_map, progress); });
    if (!commit.ok()) return commit.status();
    scans_ = {};
    kept_scans_.reset();
    return Conclude(*commit);
  }

  // Fills poses_: relative to the map's origin.
  absl::Status Align() {
    kept_scans_ = std::make_unique<SessionScans>(stores_.sessions, job_.map, job_.session, record_.scan_crc32c.size(),
                                                 stores_.scan_memory);
    const auto read = [this](size_t i) { return kept_scans_->Read(i); };
    scans_ = {kept_scans_->count(), [read](size_t i) -> absl::StatusOr<Scan> {
                absl::StatusOr<StagedScan> staged = read(i);
                if (!staged.ok()) return staged.status();
                return std::move(staged->scan);
              }};
    auto alignment = Stage<Alignment>("align", [&](const Progress& progress) -> absl::StatusOr<Alignment> {
      const auto part = [&](double begin, double share) -> Progress {
        return [&progress, begin, share](double fraction) { return progress(begin + share * fraction); };
      };
      absl::StatusOr<SessionOutline> outline = ReadOutline(scans_.count, read, part(0, 0.3));
      if (!outline.ok()) return outline.status();
      outline_ = *std::move(outline);
      record_.report.points = outline_.points;
      const bool founds = base_->epoch() == 0 && !base_->map().origin;
      if (founds) {
        Pose first = outline_.poses.front();
        if (record_.initial_pose) first.translation() = Eigen::Vector3d(record_.initial_pose->data());
        new_origin_ = OriginFor(first);
      }
      const Eigen::Vector3d origin =
          new_origin_.value_or(base_->map().origin.value_or(Eigen::Vector3d(Eigen::Vector3d::Zero())));
      std::vector<Pose> poses = outline_.poses;
      for (Pose& pose : poses) pose.translation() -= origin;
      std::optional<Pose> prior;
      if (record_.initial_pose) {
        const auto& [x, y, z, yaw] = *record_.initial_pose;
        // Relative to the map's origin; a map that has none yet gets one now.
        const Eigen::Vector3d chosen = new_origin_.value_or(Eigen::Vector3d(Eigen::Vector3d::Zero()));
        prior = PriorFrom(Eigen::Vector3d(x, y, z) - chosen, yaw, poses.front());
      }
      // There is nothing to find it in: it lies where it was said to.
      if (prior && base_->totals().blocks == 0) {
        for (Pose& pose : poses) pose = *prior * pose;
      }
      std::optional<PositionPrior> position;
      if (record_.gnss) {
        position = PositionPrior{Eigen::Vector3d(record_.gnss->data()) - origin,
                                 Eigen::Map<const Eigen::Matrix3d>(record_.gnss->data() + 3)};
      }
      return AlignToMap(*base_, stores_.plans, scans_, poses, prior, position, parameters_.align, part(0.3, 0.7));
    });
    if (!alignment.ok()) return alignment.status();
    record_.report.windows = alignment->windows;
    record_.lacks_map = alignment->lacks_map;
    if (!alignment->accepted) return absl::InvalidArgumentError(alignment->reason);
    poses_ = std::move(alignment->poses);
    return absl::OkStatus();
  }

  absl::StatusOr<Removal> Clean() {
    return Stage<Removal>("clean", [&](const Progress& progress) -> absl::StatusOr<Removal> {
      if (parameters_.clean.refine_poses) {
        auto refined = RefinePoses(scans_, poses_, parameters_.clean.refinement, {progress, 0, 0});
        if (!refined.ok()) return refined.status();
        poses_ = *std::move(refined);
      }
      return CleanAgainstMap(*base_, scans_, outline_, poses_, parameters_.clean, progress);
    });
  }

  absl::StatusOr<CommitRecord> Commit(const SessionMap& session_map, const Progress& progress) {
    const std::vector<BlockRange> reach = ReachOf(outline_, poses_, session_map.voxel_size, 0);
    const MergeInput input{*base_, session_map, scans_, poses_, reach, parameters_.clean.exposure};
    const auto began = std::chrono::steady_clock::now();
    CommitRequest request{
        .session = job_.session, .base_epoch = base_->epoch(), .lease_fence = fence_, .origin = new_origin_};
    request.blocks = [&](const Snapshot& head) -> absl::StatusOr<std::vector<Block>> {
      auto merged = MergeIntoMap(head, input, parameters_.merge, parameters_.filter, progress);
      if (!merged.ok()) return merged.status();
      record_.report.blocks_touched = merged->changed.size();
      record_.report.voxels_kept = merged->voxels;
      record_.report.static_voxels = merged->static_voxels;
      // The report must be there before the commit is: a run that is cut off right after it has nothing left to say.
      record_.report.stages.push_back({"commit", SecondsSince(began)});
      const absl::Status saved = Save(SessionState::kRunning);
      record_.report.stages.pop_back();
      if (!saved.ok()) return saved;
      return std::move(merged->changed);
    };
    return stores_.maps.Commit(job_.map, request);
  }

  absl::Status Conclude(const CommitRecord& commit) {
    record_.report.base_epoch = commit.base_epoch;
    record_.report.epoch = commit.epoch;
    if (!record_.keep_scans && !record_.scans_deleted) {
      if (absl::Status status = stores_.sessions.DeleteScans(job_.map, job_.session); !status.ok()) return status;
    }
    if (merged_) merged_();
    return End(SessionState::kCommitted, "");
  }

  absl::Status End(SessionState state, std::string reason) {
    const SessionState before = record_.state;
    record_.state = state;
    record_.reason = std::move(reason);
    record_.ended = SystemSeconds();
    if (absl::Status status = Save(before); !status.ok()) return status;
    double seconds = 0;
    for (const StageTime& stage : record_.report.stages) seconds += stage.seconds;
    switch (state) {
      case SessionState::kCommitted:
        LogInfo("session committed", {{"map", job_.map},
                                      {"session", job_.session},
                                      {"epoch", record_.report.epoch},
                                      {"scans", record_.scan_crc32c.size()},
                                      {"seconds", seconds}});
        break;
      case SessionState::kRefused:
        LogWarning("session refused", {{"map", job_.map}, {"session", job_.session}, {"reason", record_.reason}});
        break;
      default:
        LogError("session failed", {{"map", job_.map}, {"session", job_.session}, {"reason", record_.reason}});
    }
    return absl::OkStatus();
  }

  absl::Status Save(SessionState before) {
    const absl::Status status = stores_.sessions.Update(record_, before);
    if (status.ok()) {
      stores_.feed.Changed({job_.map, job_.session});
      TellChanged();
      if (HasEnded(record_.state) && stores_.events != nullptr && stores_.events->ended) stores_.events->ended(record_);
    }
    return status;
  }

  void TellChanged() const {
    if (stores_.events != nullptr && stores_.events->changed) stores_.events->changed(record_);
  }

  static double SecondsSince(std::chrono::steady_clock::time_point began) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  }

  // Runs a stage with its progress told and its time taken.
  template <typename T, typename Function>
  absl::StatusOr<T> Stage(const std::string& name, const Function& function) {
    const auto began = std::chrono::steady_clock::now();
    const Progress progress = [&](double fraction) {
      stores_.feed.SetProgress({job_.map, job_.session}, {name, fraction});
      return job_.stop == StopReason::kNone;
    };
    if (!progress(0)) return absl::CancelledError(absl::StrCat("stopped before stage ", name));
    absl::StatusOr<T> result = function(progress);
    record_.report.stages.push_back({name, SecondsSince(began)});
    if (stores_.events != nullptr && stores_.events->stage_done) {
      stores_.events->stage_done(name, record_.report.stages.back().seconds);
    }
    return result;
  }

  const PipelineStores& stores_;
  const StageParameters& parameters_;
  Job& job_;
  const uint64_t fence_;
  const std::optional<uint64_t> base_epoch_;  ///< nothing: the newest
  const std::function<void()>& merged_;
  SessionRecord record_;
  std::unique_ptr<Snapshot> base_;
  std::unique_ptr<SessionScans> kept_scans_;
  ScanSource scans_;  ///< of kept_scans_
  SessionOutline outline_;
  std::optional<Eigen::Vector3d> new_origin_;
  std::vector<Pose> poses_;
};

}  // namespace

absl::Status RunSession(const PipelineStores& stores, const StageParameters& parameters, Job& job, uint64_t fence,
                        std::optional<uint64_t> base_epoch, const std::function<void()>& merged) {
  return SessionRun(stores, parameters, job, fence, base_epoch, merged).Run();
}

uint32_t MinutesSince2000(double seconds) {
  return static_cast<uint32_t>(std::clamp(std::floor(seconds / 60) - kMinutesBetween1970And2000, 0.0, 4294967295.0));
}

}  // namespace mapkeep
