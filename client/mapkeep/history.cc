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
  return change;
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

absl::Status Client::CompareEpochs(std::string_view map, uint64_t before, std::optional<uint64_t> after,
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
  for (v1::CompareEpochsResponse response; status.ok() && stream->Read(&response);) {
    if (response.has_header() && !begun) {
      begun = true;
      status = begin(mapkeep::FromWire(response.header()));
    } else if (response.has_change() && begun) {
      const absl::StatusOr<BlockChangeInfo> received = FromWire(response.change());
      status = received.ok() ? change(*received) : received.status();
    } else {
      status = absl::DataLossError("the server's stream does not begin with one header");
    }
  }
  if (!status.ok()) context.TryCancel();
  const absl::Status finished = connection_->StatusOf(stream->Finish());
  if (!status.ok()) return status;
  if (finished.ok() && !begun) return absl::DataLossError("the server's stream holds no header");
  return finished;
}

}  // namespace mapkeep
