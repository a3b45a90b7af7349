#include <absl/strings/numbers.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "server/rpc/answer.h"
#include "server/rpc/convert.h"
#include "server/rpc/gate.h"
#include "server/rpc/map_watch.h"
#include "server/rpc/paging.h"
#include "server/rpc/pulled_stream.h"
#include "server/rpc/tile_buffers.h"
#include "server/rpc/tile_message.h"
#include "server/rpc/tile_selection.h"
#include "server/rpc/tile_service.h"

namespace mapkeep {
namespace {

constexpr uint32_t kDefaultPage = 1000, kLargestPage = 10000;

template <typename Request>
std::optional<uint64_t> EpochOf(const Request& request) {
  return request.has_epoch() ? std::optional<uint64_t>(request.epoch()) : std::nullopt;
}

template <typename Request>
const v1::Box* AreaOf(const Request& request) {
  return request.has_area() ? &request.area() : nullptr;
}

/// Where a listing goes on: at which epoch, after which tile.
struct ListPosition {
  uint64_t epoch = 0;
  uint32_t after = 0;
};

absl::StatusOr<std::optional<ListPosition>> PositionIn(const std::string& token) {
  if (token.empty()) return std::nullopt;
  const absl::StatusOr<std::string> text = PositionOf(token);
  if (!text.ok()) return text.status();
  const std::vector<std::string> parts = absl::StrSplit(*text, '.');
  ListPosition position;
  if (parts.size() != 2 || !absl::SimpleAtoi(parts[0], &position.epoch) ||
      !absl::SimpleAtoi(parts[1], &position.after)) {
    return absl::InvalidArgumentError("page_token: expected one from an earlier answer");
  }
  return position;
}

absl::Status List(const ServiceContext& context, const v1::ListTilesRequest& request, v1::ListTilesResponse& response) {
  const auto position = PositionIn(request.page_token());
  if (!position.ok()) return position.status();
  const std::optional<uint64_t> epoch = *position ? std::optional((*position)->epoch) : EpochOf(request);
  const auto selection = SelectTiles(context, request.map(), epoch, AreaOf(request));
  if (!selection.ok()) return selection.status();
  response.set_epoch(selection->snapshot->epoch());
  const uint32_t page = request.page_size() == 0 ? kDefaultPage : std::min(request.page_size(), kLargestPage);
  for (const TileEntry& entry : selection->tiles) {
    if (*position && static_cast<uint32_t>(entry.key) <= (*position)->after) continue;
    if (response.tiles_size() == static_cast<int>(page)) {
      const v1::TileId& last = response.tiles().rbegin()->id();
      const auto key = static_cast<uint32_t>(TileKeyOf(VoxelIndex{last.x(), last.y(), 0}));
      response.set_next_page_token(PageToken(absl::StrFormat("%d.%d", response.epoch(), key)));
      break;
    }
    *response.add_tiles() = DescribeTile(*selection->snapshot, entry, request.detail());
  }
  return absl::OkStatus();
}

v1::TileStreamHeader HeaderOf(const Snapshot& snapshot) {
  const MapRecord& map = snapshot.map();
  v1::TileStreamHeader header;
  header.set_epoch(snapshot.epoch());
  header.set_voxel_size(map.voxel_size);
  if (map.origin) *header.mutable_origin() = ToProto(*map.origin);
  header.set_crs(map.crs);
  return header;
}

/// The messages of a GetTiles call, one after the other.
class GetSequence {
 public:
  using Request = v1::GetTilesRequest;

  GetSequence(const ServiceContext& context, TileBuffers& buffers, Request request)
      : context_(context), buffers_(buffers), request_(std::move(request)) {}

  absl::StatusOr<Pulled> Next(grpc::ByteBuffer& message) {
    if (!selection_.snapshot) {
      auto selected = request_.ids().empty()
                          ? SelectTiles(context_, request_.map(), EpochOf(request_), AreaOf(request_))
                          : SelectTiles(context_, request_.map(), EpochOf(request_), request_.ids());
      if (!selected.ok()) return selected.status();
      selection_ = *std::move(selected);
      v1::GetTilesResponse response;
      *response.mutable_header() = HeaderOf(*selection_.snapshot);
      message = BufferOf(response);
      return MoreOrLast();
    }
    auto tile = buffers_.Of(*selection_.snapshot, selection_.tiles[next_++], request_.detail());
    if (!tile.ok()) return tile.status();
    message = *std::move(tile);
    return MoreOrLast();
  }

 private:
  Pulled MoreOrLast() const { return next_ < selection_.tiles.size() ? Pulled::kMore : Pulled::kLast; }

  const ServiceContext context_;
  TileBuffers& buffers_;
  const Request request_;
  TileSelection selection_;
  size_t next_ = 0;
};

/// The messages of a SyncTiles call, one after the other.
class SyncSequence {
 public:
  using Request = v1::SyncTilesRequest;

  SyncSequence(const ServiceContext& context, TileBuffers& buffers, Request request)
      : context_(context), buffers_(buffers), request_(std::move(request)) {}

  absl::StatusOr<Pulled> Next(grpc::ByteBuffer& message) {
    if (!snapshot_) {
      v1::SyncTilesResponse response;
      if (absl::Status status = Open(*response.mutable_header()); !status.ok()) return status;
      message = BufferOf(response);
      return MoreOrLast();
    }
    const TileEntry& entry = changed_[next_++];
    if (request_.list_only()) {
      v1::SyncTilesResponse response;
      *response.mutable_info() = DescribeTile(*snapshot_, entry, request_.detail());
      message = BufferOf(response);
      return MoreOrLast();
    }
    auto tile = buffers_.Of(*snapshot_, entry, request_.detail());
    if (!tile.ok()) return tile.status();
    message = *std::move(tile);
    return MoreOrLast();
  }

 private:
  Pulled MoreOrLast() const { return next_ < changed_.size() ? Pulled::kMore : Pulled::kLast; }

  absl::Status Open(v1::SyncTilesHeader& header) {
    auto selected = SelectTiles(context_, request_.map(), EpochOf(request_), AreaOf(request_));
    if (!selected.ok()) return selected.status();
    auto changes = ChangesFor(request_.held(), selected->tiles);
    if (!changes.ok()) return changes.status();
    request_.clear_held();
    snapshot_ = std::move(selected->snapshot);
    changed_ = std::move(changes->changed);
    header.set_epoch(snapshot_->epoch());
    for (const v1::TileId& id : changes->dropped) *header.add_dropped() = id;
    header.set_changed_tiles(changed_.size());
    uint64_t bytes = 0;
    for (const TileEntry& entry : changed_) bytes += DescribeTile(*snapshot_, entry, request_.detail()).bytes();
    header.set_changed_bytes(bytes);
    header.set_tiles(selected->tiles.size());
    return absl::OkStatus();
  }

  const ServiceContext context_;
  TileBuffers& buffers_;
  Request request_;
  std::unique_ptr<Snapshot> snapshot_;
  std::vector<TileEntry> changed_;
  size_t next_ = 0;
};

using BytesReactor = grpc::ServerWriteReactor<grpc::ByteBuffer>;

/// A stream of what the sequence gives, if the gate admits the call.
template <typename Sequence>
BytesReactor* StreamOf(const ServiceContext& context, TileBuffers& buffers, grpc::CallbackServerContext& call,
                       grpc::ByteBuffer bytes) {
  typename Sequence::Request request;
  if (!grpc::SerializationTraits<typename Sequence::Request>::Deserialize(&bytes, &request).ok()) {
    return new Refused<BytesReactor>(
        ToGrpc(absl::InvalidArgumentError(absl::StrFormat("this is not a %s", request.GetDescriptor()->full_name()))));
  }
  return Admitted<BytesReactor>(context.gate, call, request, [&](const Call&) {
    auto sequence = std::make_shared<Sequence>(context, buffers, std::move(request));
    return PulledStream<grpc::ByteBuffer>::Start(
        context.pool, [sequence](grpc::ByteBuffer& message) { return sequence->Next(message); });
  });
}

}  // namespace

grpc::ServerUnaryReactor* TileService::ListTiles(grpc::CallbackServerContext* call, const v1::ListTilesRequest* request,
                                                 v1::ListTilesResponse* response) {
  return Answer(call, context_, *request, [=, this] { return List(context_, *request, *response); });
}

BytesReactor* TileService::GetTiles(grpc::CallbackServerContext* call, const grpc::ByteBuffer* request) {
  return StreamOf<GetSequence>(context_, buffers_, *call, *request);
}

BytesReactor* TileService::SyncTiles(grpc::CallbackServerContext* call, const grpc::ByteBuffer* request) {
  return StreamOf<SyncSequence>(context_, buffers_, *call, *request);
}

grpc::ServerWriteReactor<v1::WatchMapResponse>* TileService::WatchMap(grpc::CallbackServerContext* call,
                                                                      const v1::WatchMapRequest* request) {
  return Admitted<grpc::ServerWriteReactor<v1::WatchMapResponse>>(
      context_.gate, *call, *request, [&](const Call&) { return NewMapWatch(context_, *request); });
}

}  // namespace mapkeep
