#include <string>
#include <utility>

#include "client/mapkeep/client.h"
#include "client/mapkeep/connection.h"
#include "client/mapkeep/wire.h"

namespace mapkeep {
namespace {

using Maps = v1::MapService::Stub;

constexpr size_t kPageSize = 1000;

VersionInfo FromWire(const v1::Version& version) {
  return {.epoch = version.epoch(),
          .session = version.session(),
          .base_epoch = version.base_epoch(),
          .rollback = version.rollback(),
          .time = version.time(),
          .touched_tiles = version.touched_tiles(),
          .readable = version.readable(),
          .voxels = version.voxels(),
          .static_voxels = version.static_voxels(),
          .sessions = version.sessions(),
          .tags = {version.tags().begin(), version.tags().end()}};
}

absl::StatusOr<BlockChangeInfo> FromWire(const v1::BlockChange& wire) {
  BlockChangeInfo change;
  if (wire.has_appeared()) {
    absl::StatusOr<Block> block = mapkeep::FromWire(wire.appeared());
    if (!block.ok()) return block.status();
    change.appeared = *std::move(block);
  }
  if (wire.has_disappeared()) {
    absl::StatusOr<Block> block = mapkeep::FromWire(wire.disappeared());
    if (!block.ok()) return block.status();
    change.disappeared = *std::move(block);
  }
  if (wire.has_unstable()) {
    absl::StatusOr<Block> block = mapkeep::FromWire(wire.unstable());
    if (!block.ok()) return block.status();
    change.unstable = *std::move(block);
  }
  return change;
}

absl::StatusOr<ChangeClass> FromWire(v1::ChangeClass change) {
  switch (change) {
    case v1::CHANGE_CLASS_APPEARED:
      return ChangeClass::kAppeared;
    case v1::CHANGE_CLASS_DISAPPEARED:
      return ChangeClass::kDisappeared;
    case v1::CHANGE_CLASS_UNSTABLE:
      return ChangeClass::kUnstable;
    default:
      return absl::DataLossError("the server sent a change of an unknown class");
  }
}

absl::StatusOr<ChangedObjectsInfo> FromWire(const v1::ChangedObjects& wire) {
  ChangedObjectsInfo objects{.objects = {}, .too_many = wire.too_many()};
  for (const v1::ChangedObject& object : wire.objects()) {
    const absl::StatusOr<ChangeClass> change = FromWire(object.change());
    if (!change.ok()) return change.status();
    objects.objects.push_back({.change = *change,
                               .voxels = object.voxels(),
                               .box = {mapkeep::FromWire(object.box().min()), mapkeep::FromWire(object.box().max())},
                               .centre = mapkeep::FromWire(object.centre())});
  }
  return objects;
}

}  // namespace

absl::StatusOr<std::vector<VersionInfo>> Client::ListVersions(std::string_view map, size_t limit) const {
  std::vector<VersionInfo> versions;
  v1::ListVersionsRequest request;
  request.set_map(std::string(map));
  do {
    request.set_page_size(static_cast<uint32_t>(std::min(kPageSize, limit - versions.size())));
    v1::ListVersionsResponse response;
    const absl::Status status = connection_->Call(connection_->maps(), &Maps::ListVersions, request, &response);
    if (!status.ok()) return status;
    for (const v1::Version& version : response.versions()) versions.push_back(FromWire(version));
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty() && versions.size() < limit);
  return versions;
}

absl::StatusOr<uint64_t> Client::AddTag(std::string_view map, std::string_view tag,
                                        std::optional<uint64_t> epoch) const {
  v1::AddTagRequest request;
  request.set_map(std::string(map));
  request.set_tag(std::string(tag));
  if (epoch) request.set_epoch(*epoch);
  v1::AddTagResponse response;
  const absl::Status status = connection_->Call(connection_->maps(), &Maps::AddTag, request, &response);
  if (!status.ok()) return status;
  return response.epoch();
}

absl::Status Client::RemoveTag(std::string_view map, std::string_view tag) const {
  v1::RemoveTagRequest request;
  request.set_map(std::string(map));
  request.set_tag(std::string(tag));
  v1::RemoveTagResponse response;
  return connection_->Call(connection_->maps(), &Maps::RemoveTag, request, &response);
}

absl::StatusOr<RollbackInfo> Client::RollBackMap(std::string_view map, uint64_t epoch) const {
  v1::RollBackMapRequest request;
  request.set_map(std::string(map));
  request.set_epoch(epoch);
  v1::RollBackMapResponse response;
  const absl::Status status = connection_->Call(connection_->maps(), &Maps::RollBackMap, request, &response);
  if (!status.ok()) return status;
  return RollbackInfo{response.epoch(),
                      {response.rolled_back().begin(), response.rolled_back().end()},
                      {response.brought_back().begin(), response.brought_back().end()}};
}

absl::StatusOr<ChangedObjectsInfo> Client::CompareEpochs(
    std::string_view map, uint64_t before, std::optional<uint64_t> after,
    const std::function<absl::Status(const MapSnapshot&)>& begin,
    const std::function<absl::Status(const BlockChangeInfo&)>& change) const {
  absl::Status status = connection_->WaitForServer();
  if (!status.ok()) return status;
  v1::CompareEpochsRequest request;
  request.set_map(std::string(map));
  request.set_before(before);
  if (after) request.set_after(*after);
  grpc::ClientContext context;
  const auto stream = connection_->maps().CompareEpochs(&context, request);
  bool begun = false;
  std::optional<ChangedObjectsInfo> objects;
  for (v1::CompareEpochsResponse response; status.ok() && stream->Read(&response);) {
    if (response.has_header() && !begun) {
      begun = true;
      status = begin(mapkeep::FromWire(response.header()));
    } else if (response.has_change() && begun && !objects) {
      const absl::StatusOr<BlockChangeInfo> received = FromWire(response.change());
      status = received.ok() ? change(*received) : received.status();
    } else if (response.has_objects() && begun && !objects) {
      absl::StatusOr<ChangedObjectsInfo> received = FromWire(response.objects());
      status = received.status();
      if (received.ok()) objects = *std::move(received);
    } else {
      status = absl::DataLossError("the server's stream is not a header, changes, and objects");
    }
  }
  if (!status.ok()) context.TryCancel();
  const absl::Status finished = connection_->StatusOf(stream->Finish());
  if (!status.ok()) return status;
  if (!finished.ok()) return finished;
  if (!objects) return absl::DataLossError("the server's stream ended without the objects");
  return *std::move(objects);
}

}  // namespace mapkeep
