#include "server/rpc/admin_service.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <filesystem>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <string>
#include <vector>

#include "server/housekeeping.h"
#include "server/log.h"
#include "server/names.h"
#include "server/pipeline/replay.h"
#include "server/rpc/answer.h"
#include "server/scratch_directory.h"
#include "storage/collector.h"
#include "storage/map_copy.h"
#include "storage/overlay_engine.h"
#include "storage/rocksdb_engine.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

// Goes on until the client is gone.
Progress WhileWanted(grpc::CallbackServerContext* call) {
  return [call](double) { return !call->IsCancelled(); };
}

// What holds of every block that the merge has made (core/ratio_map/merge.h).
absl::Status CheckBlock(const Block& block) {
  for (const Voxel& voxel : block.voxels) {
    if (voxel.hits < kCountScale / 4) {
      return absl::InternalError(absl::StrFormat("voxel %d has H below 1/4 scan", voxel.position));
    }
    if (voxel.mask == 0) return absl::InternalError(absl::StrFormat("voxel %d has no point", voxel.position));
    if (voxel.first_seen > voxel.last_seen) {
      return absl::InternalError(absl::StrFormat("voxel %d was last seen before it was first", voxel.position));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckDirectory(const std::string& directory) {
  if (fs::path(directory).is_absolute()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("directory \"", directory, "\": expected an absolute path on the daemon's machine"));
}

}  // namespace

grpc::ServerUnaryReactor* AdminService::VerifyMap(grpc::CallbackServerContext* call,
                                                  const v1::VerifyMapRequest* request,
                                                  v1::VerifyMapResponse* response) {
  return Answer(call, context_, *request, [=, this] { return Verify(*request, *response, WhileWanted(call)); });
}

grpc::ServerUnaryReactor* AdminService::CollectGarbage(grpc::CallbackServerContext* call,
                                                       const v1::CollectGarbageRequest* request,
                                                       v1::CollectGarbageResponse* response) {
  return Answer(call, context_, *request, [=, this] { return Collect(*request, *response, WhileWanted(call)); });
}

grpc::ServerUnaryReactor* AdminService::Backup(grpc::CallbackServerContext* call, const v1::BackupRequest* request,
                                               v1::BackupResponse* response) {
  return Answer(call, context_, *request, [=, this] { return MakeBackup(*request, *response); });
}

grpc::ServerUnaryReactor* AdminService::Restore(grpc::CallbackServerContext* call, const v1::RestoreRequest* request,
                                                v1::RestoreResponse* response) {
  return Answer(call, context_, *request, [=, this] { return TakeBackup(*request, *response, WhileWanted(call)); });
}

grpc::ServerUnaryReactor* AdminService::ReplayMap(grpc::CallbackServerContext* call,
                                                  const v1::ReplayMapRequest* request,
                                                  v1::ReplayMapResponse* response) {
  return Answer(call, context_, *request, [=, this] { return Replay(*request, *response, WhileWanted(call)); });
}

absl::Status AdminService::Verify(const v1::VerifyMapRequest& request, v1::VerifyMapResponse& response,
                                  const Progress& progress) {
  if (absl::Status status = CheckName("map name", request.map()); !status.ok()) return status;
  const auto found = context_.maps.Verify(request.map(), CheckBlock, progress);
  if (!found.ok()) return found.status();
  response.set_epochs(found->epochs);
  response.set_nodes(found->nodes);
  response.set_blocks(found->blocks);
  response.set_voxels(found->voxels);
  response.set_problem_count(found->problem_count);
  for (const std::string& problem : found->problems) response.add_problems(problem);
  if (found->problem_count > 0) {
    LogError("map is damaged",
             {{"map", request.map()}, {"problems", found->problem_count}, {"first", found->problems[0]}});
  }
  return absl::OkStatus();
}

absl::Status AdminService::Collect(const v1::CollectGarbageRequest& request, v1::CollectGarbageResponse& response,
                                   const Progress& progress) {
  const GarbageOptions options = GarbageOptionsOf(context_.config.history);
  absl::StatusOr<GarbageCounts> counts;
  if (request.dry_run()) {
    OverlayEngine trial(context_.engine);
    GarbageOptions unpaced = options;
    unpaced.values_per_second = 0;
    counts = mapkeep::CollectGarbage(trial, unpaced, progress);
  } else {
    counts = mapkeep::CollectGarbage(context_.engine, options, progress);
  }
  if (!counts.ok()) return counts.status();
  response.set_epochs(counts->epochs);
  response.set_values(counts->values);
  response.set_attempts(counts->attempts);
  response.set_maps(counts->maps);
  response.set_sessions(counts->sessions);
  return absl::OkStatus();
}

absl::Status AdminService::MakeBackup(const v1::BackupRequest& request, v1::BackupResponse& response) {
  const std::string& directory = request.directory();
  if (absl::Status status = CheckDirectory(directory); !status.ok()) return status;
  if (fs::exists(directory)) return absl::AlreadyExistsError(absl::StrCat(directory, " is there already"));
  if (context_.config.engine.choice == EngineChoice::kRocksDb) {
    if (!request.map().empty() || request.has_epoch()) {
      return absl::InvalidArgumentError("a backup of RocksDB holds every map and epoch: leave map and epoch out");
    }
    if (absl::Status status = context_.engine.Checkpoint(directory); !status.ok()) return status;
    const auto names = MapNames(context_.engine);
    if (!names.ok()) return names.status();
    for (const std::string& name : *names) response.add_maps(name);
  } else {
    if (absl::Status status = CheckName("map name", request.map()); !status.ok()) return status;
    const auto pinned =
        context_.maps.Open(request.map(), request.has_epoch() ? std::optional(request.epoch()) : std::nullopt);
    if (!pinned.ok()) return pinned.status();
    const auto target = OpenRocksDbEngine(directory);
    if (!target.ok()) return target.status();
    const absl::Status copied = CopyMap(context_.engine, **target, request.map(), request.map(), (*pinned)->epoch());
    if (!copied.ok()) return copied;
    if (absl::Status status = (*target)->Sync(); !status.ok()) return status;
    response.add_maps(request.map());
  }
  LogInfo("backup made", {{"directory", directory}, {"maps", response.maps_size()}});
  return absl::OkStatus();
}

absl::Status AdminService::TakeBackup(const v1::RestoreRequest& request, v1::RestoreResponse& response,
                                      const Progress& progress) {
  const std::string& directory = request.directory();
  if (absl::Status status = CheckDirectory(directory); !status.ok()) return status;
  if (!request.as().empty() && request.map().empty()) {
    return absl::InvalidArgumentError("a new name is for one map: say which");
  }
  if (!fs::exists(fs::path(directory) / "CURRENT")) {
    return absl::NotFoundError(absl::StrCat(directory, " is no backup"));
  }
  const auto backup = OpenRocksDbEngine(directory);
  if (!backup.ok()) return backup.status();
  std::vector<std::string> names = {request.map()};
  if (request.map().empty()) {
    auto all = MapNames(**backup);
    if (!all.ok()) return all.status();
    names = *std::move(all);
  }
  for (const std::string& name : names) {
    const std::string as = request.as().empty() ? name : request.as();
    if (absl::Status status = CheckName("map name", as); !status.ok()) return status;
    const std::unique_lock alone(context_.map_lifetimes);
    if (absl::Status s = CopyMap(**backup, context_.engine, name, as, {}, progress); !s.ok()) return s;
    response.add_maps(as);
    LogInfo("map restored", {{"map", as}, {"from", directory}});
  }
  return context_.pipeline.ResumeUnfinished();
}

absl::Status AdminService::Replay(const v1::ReplayMapRequest& request, v1::ReplayMapResponse& response,
                                  const Progress& progress) {
  if (absl::Status status = CheckName("map name", request.map()); !status.ok()) return status;
  const ScratchDirectory scratch(context_.config.data, "replay");
  const auto report = mapkeep::ReplayMap(context_.engine, context_.maps, context_.sessions, context_.config.stages,
                                         request.map(), scratch.path(), progress);
  if (!report.ok()) return report.status();
  response.set_commits(report->commits);
  response.set_blocks(report->blocks);
  response.set_different(report->different);
  response.set_first_difference(report->first_difference);
  return absl::OkStatus();
}

}  // namespace mapkeep
