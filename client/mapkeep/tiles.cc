#include <absl/status/status.h>
#include <absl/time/clock.h>

#include <string>
#include <utility>

#include "client/mapkeep/client.h"
#include "client/mapkeep/connection.h"
#include "client/mapkeep/wire.h"

namespace mapkeep {
namespace {

using Tiles = v1::TileService::Stub;

constexpr uint32_t kPageSize = 10000;
constexpr absl::Duration kLongEnough = absl::Seconds(5);  // that a watch lived, to have been one

v1::TileDetail ToWire(TileDetail detail) {
  return detail == TileDetail::kSubVoxels ? v1::TILE_DETAIL_SUB_VOXELS : v1::TILE_DETAIL_CENTROIDS;
}

TileId FromWire(const v1::TileId& id) { return {id.x(), id.y()}; }

TileInfo FromWire(const v1::TileInfo& info) {
  return {FromWire(info.id()), info.version(), info.bytes(), info.voxels()};
}

void ToWire(const TileId& id, v1::TileId* wire) {
  wire->set_x(id.x);
  wire->set_y(id.y);
}

template <typename Request>
Request RequestFor(const TileQuery& query) {
  Request request;
  request.set_map(query.map);
  if (query.epoch) request.set_epoch(*query.epoch);
  if (query.area) mapkeep::ToWire(*query.area, request.mutable_area());
  request.set_detail(ToWire(query.detail));
  return request;
}

EncodedTile Encoded(const v1::MapTile& tile) { return {FromWire(tile.id()), tile.version(), tile.SerializeAsString()}; }

absl::Status NoHeader() { return absl::DataLossError("the server's stream does not begin with one header"); }

MapEvent FromWire(const v1::WatchMapResponse& wire) {
  MapEvent event{.epoch = wire.epoch(),
                 .session = wire.session(),
                 .rollback = wire.rollback(),
                 .tiles = {},
                 .any_tile = wire.any_tile(),
                 .resume_token = wire.resume_token()};
  for (const v1::TileId& id : wire.touched_tiles()) event.tiles.push_back(FromWire(id));
  return event;
}

}  // namespace

absl::StatusOr<TileList> Client::ListTiles(const TileQuery& query) const {
  TileList list;
  auto request = RequestFor<v1::ListTilesRequest>(query);
  request.set_page_size(kPageSize);
  do {
    v1::ListTilesResponse response;
    const absl::Status status = connection_->Call(connection_->tiles(), &Tiles::ListTiles, request, &response);
    if (!status.ok()) return status;
    list.epoch = response.epoch();
    for (const v1::TileInfo& tile : response.tiles()) list.tiles.push_back(FromWire(tile));
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  return list;
}

absl::StatusOr<uint64_t> Client::GetTiles(const TileQuery& query, const std::vector<TileId>& ids,
                                          const std::function<absl::Status(const EncodedTile&)>& tile) const {
  absl::Status status = connection_->WaitForServer();
  if (!status.ok()) return status;
  auto request = RequestFor<v1::GetTilesRequest>(query);
  for (const TileId& id : ids) ToWire(id, request.add_ids());
  grpc::ClientContext context;
  const auto stream = connection_->tiles().GetTiles(&context, request);
  std::optional<uint64_t> epoch;
  for (v1::GetTilesResponse response; status.ok() && stream->Read(&response);) {
    if (response.has_header() && !epoch) {
      epoch = response.header().epoch();
    } else {
      status = response.has_tile() && epoch ? tile(Encoded(response.tile())) : NoHeader();
    }
  }
  if (!status.ok()) context.TryCancel();
  const absl::Status finished = connection_->StatusOf(stream->Finish());
  if (!status.ok()) return status;
  if (!finished.ok()) return finished;
  if (!epoch) return NoHeader();
  return *epoch;
}

absl::Status Client::SyncTiles(const TileQuery& query, const std::vector<HeldTile>& held,
                               const std::function<absl::Status(const TileChangesInfo&)>& begin,
                               const std::function<absl::Status(const EncodedTile&)>& tile) const {
  absl::Status status = connection_->WaitForServer();
  if (!status.ok()) return status;
  auto request = RequestFor<v1::SyncTilesRequest>(query);
  for (const HeldTile& have : held) {
    v1::TileVersion& wire = *request.add_held();
    ToWire(have.id, wire.mutable_id());
    wire.set_version(have.version);
  }
  grpc::ClientContext context;
  const auto stream = connection_->tiles().SyncTiles(&context, request);
  bool begun = false;
  for (v1::SyncTilesResponse response; status.ok() && stream->Read(&response);) {
    if (response.has_header() && !begun) {
      begun = true;
      const v1::SyncTilesHeader& header = response.header();
      TileChangesInfo changes{.epoch = header.epoch(),
                              .dropped = {},
                              .changed_tiles = header.changed_tiles(),
                              .changed_bytes = header.changed_bytes(),
                              .tiles = header.tiles()};
      for (const v1::TileId& id : header.dropped()) changes.dropped.push_back(FromWire(id));
      status = begin(changes);
    } else {
      status = response.has_tile() && begun ? tile(Encoded(response.tile())) : NoHeader();
    }
  }
  if (!status.ok()) context.TryCancel();
  const absl::Status finished = connection_->StatusOf(stream->Finish());
  if (!status.ok()) return status;
  return finished.ok() && !begun ? NoHeader() : finished;
}

absl::StatusOr<std::string> Client::WatchMap(std::string_view map, std::string resume_token,
                                             const std::function<bool(const MapEvent&)>& event) const {
  Patience patience(connection_->options().patience_seconds);
  v1::WatchMapRequest request;
  request.set_map(std::string(map));
  for (bool reached = !resume_token.empty();;) {
    absl::Status status = connection_->WaitForServer();
    if (status.ok()) {
      const absl::Time began = absl::Now();
      request.set_resume_token(resume_token);
      grpc::ClientContext context;
      const auto stream = connection_->tiles().WatchMap(&context, request);
      bool stopped = false;
      for (v1::WatchMapResponse response; !stopped && stream->Read(&response);) {
        reached = true;
        const MapEvent received = FromWire(response);
        resume_token = received.resume_token;
        if (event(received)) continue;
        stopped = true;
        context.TryCancel();
      }
      status = connection_->StatusOf(stream->Finish());
      if (stopped) return resume_token;
      // A watch without news is no break, and a server ends watches by itself, so that streams spread anew.
      if (absl::Now() - began > kLongEnough) patience.Renew();
      reached = reached || status.ok();
    }
    if (!status.ok() && !(reached && absl::IsUnavailable(status))) return status;
    if (!patience.Wait()) return status;
  }
}

}  // namespace mapkeep
