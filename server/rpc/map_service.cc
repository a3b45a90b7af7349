#include "server/rpc/map_service.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "core/voxels/block.h"
#include "server/log.h"
#include "server/names.h"
#include "server/rpc/answer.h"
#include "server/rpc/convert.h"
#include "server/rpc/paging.h"
#include "server/rpc/voxel_answer.h"
#include "storage/clock.h"

namespace mapkeep {
namespace {

constexpr double kDefaultVoxelSize = 0.2, kSmallestVoxelSize = 0.05, kLargestVoxelSize = 1.0;  // metres

}  // namespace

grpc::ServerUnaryReactor* MapService::CreateMap(grpc::CallbackServerContext* call, const v1::CreateMapRequest* request,
                                                v1::CreateMapResponse* response) {
  return Answer(call, context_, *request, [=, this] { return Create(*request, *response); });
}

grpc::ServerUnaryReactor* MapService::GetMap(grpc::CallbackServerContext* call, const v1::GetMapRequest* request,
                                             v1::GetMapResponse* response) {
  return Answer(call, context_, *request, [=, this]() -> absl::Status {
    if (absl::Status status = CheckName("map name", request->name()); !status.ok()) return status;
    const auto snapshot = context_.maps.Open(request->name());
    if (!snapshot.ok()) return snapshot.status();
    *response->mutable_map() = ToProto(**snapshot);
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* MapService::ListMaps(grpc::CallbackServerContext* call, const v1::ListMapsRequest* request,
                                               v1::ListMapsResponse* response) {
  return Answer(call, context_, *request, [=, this](const Call& of) { return List(of, *request, *response); });
}

grpc::ServerUnaryReactor* MapService::DeleteMap(grpc::CallbackServerContext* call, const v1::DeleteMapRequest* request,
                                                v1::DeleteMapResponse*) {
  return Answer(call, context_, *request, [=, this] { return Delete(*request); });
}

grpc::ServerUnaryReactor* MapService::QueryVoxel(grpc::CallbackServerContext* call,
                                                 const v1::QueryVoxelRequest* request,
                                                 v1::QueryVoxelResponse* response) {
  return Answer(call, context_, *request, [=, this] { return Query(*request, *response); });
}

absl::StatusOr<MapRecord> NewMapRecord(const v1::CreateMapRequest& request) {
  if (absl::Status status = CheckName("map name", request.name()); !status.ok()) return status;
  if (absl::Status status = CheckCrs(request.crs()); !status.ok()) return status;
  MapRecord record{
      .name = request.name(), .voxel_size = kDefaultVoxelSize, .crs = request.crs(), .created = SystemSeconds()};
  if (request.voxel_size() != 0) record.voxel_size = request.voxel_size();
  if (!(record.voxel_size >= kSmallestVoxelSize && record.voxel_size <= kLargestVoxelSize)) {
    return absl::InvalidArgumentError(absl::StrFormat("voxel_size %g m: expected %g to %g m", record.voxel_size,
                                                      kSmallestVoxelSize, kLargestVoxelSize));
  }
  if (request.has_origin()) {
    const auto origin = FromProto(request.origin(), "origin");
    if (!origin.ok()) return origin.status();
    record.origin = *origin;
  }
  return record;
}

absl::Status MapService::Create(const v1::CreateMapRequest& request, v1::CreateMapResponse& response) {
  const absl::StatusOr<MapRecord> made = NewMapRecord(request);
  if (!made.ok()) return made.status();
  const MapRecord& record = *made;
  const std::unique_lock alone(context_.map_lifetimes);
  if (absl::IsNotFound(context_.maps.Find(record.name).status())) {
    // A daemon that ended while it deleted a map of this name may have left sessions of it.
    if (absl::Status status = context_.sessions.DeleteAll(record.name); !status.ok()) return status;
  }
  if (absl::Status status = context_.maps.Create(record).status(); !status.ok()) return status;
  LogInfo("map created", {{"map", record.name}, {"voxel_size", record.voxel_size}});
  const auto snapshot = context_.maps.Open(record.name);
  if (!snapshot.ok()) return snapshot.status();
  *response.mutable_map() = ToProto(**snapshot);
  return absl::OkStatus();
}

absl::Status MapService::List(const Call& call, const v1::ListMapsRequest& request, v1::ListMapsResponse& response) {
  const auto after = PositionOf(request.page_token());
  if (!after.ok()) return after.status();
  const size_t size = PageSize(request.page_size());
  const auto records = context_.maps.List(*after, size + 1);
  if (!records.ok()) return records.status();
  for (size_t i = 0; i < std::min(size, records->size()); ++i) {
    if (!call.caller.May(Access::kRead, (*records)[i].name)) continue;
    const auto snapshot = context_.maps.Open((*records)[i].name);
    if (absl::IsNotFound(snapshot.status())) continue;  // deleted since
    if (!snapshot.ok()) return snapshot.status();
    *response.add_maps() = ToProto(**snapshot);
  }
  if (records->size() > size) response.set_next_page_token(PageToken((*records)[size - 1].name));
  return absl::OkStatus();
}

absl::Status MapService::Delete(const v1::DeleteMapRequest& request) {
  const std::string& name = request.name();
  if (absl::Status status = CheckName("map name", name); !status.ok()) return status;
  const std::unique_lock alone(context_.map_lifetimes);
  if (absl::Status status = context_.maps.Find(name).status(); !status.ok()) return status;
  context_.pipeline.StopMap(name);
  if (absl::Status status = context_.maps.Delete(name); !status.ok()) return status;
  if (absl::Status status = context_.sessions.DeleteAll(name); !status.ok()) return status;
  context_.quotas.ForgetMap(name);
  LogInfo("map deleted", {{"map", name}});
  return absl::OkStatus();
}

absl::Status MapService::Query(const v1::QueryVoxelRequest& request, v1::QueryVoxelResponse& response) {
  if (absl::Status status = CheckName("map name", request.map()); !status.ok()) return status;
  const auto point = FromProto(request.point(), "point");
  if (!point.ok()) return point.status();
  const auto snapshot =
      context_.maps.Open(request.map(), request.has_epoch() ? std::optional<uint64_t>(request.epoch()) : std::nullopt);
  if (!snapshot.ok()) return snapshot.status();
  auto found = VoxelAt(**snapshot, *point, context_.config.stages.filter.eta);
  if (!found.ok()) return found.status();
  response = *std::move(found);
  return absl::OkStatus();
}

}  // namespace mapkeep
