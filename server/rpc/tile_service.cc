#include "server/rpc/tile_service.h"

#include <absl/status/statusor.h>

#include <atomic>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "server/names.h"
#include "server/rpc/convert.h"
#include "server/rpc/grpc_status.h"

namespace mapkeep {
namespace {

using Reactor = grpc::ServerWriteReactor<v1::StreamTilesResponse>;

// Alternates between a step on the pool, which fills the next message, and its write; never both. Deletes itself.
class TileStream final : public Reactor {
 public:
  TileStream(const ServiceContext& context, const v1::StreamTilesRequest& request)
      : context_(context), request_(request) {
    context_.pool.Submit([this] { Open(); });
  }

  void OnWriteDone(bool ok) override {
    if (ok && !cancelled_) {
      context_.pool.Submit([this] { Next(); });
    } else {
      Finish(grpc::Status(grpc::StatusCode::CANCELLED, "the client went away"));
    }
  }

  void OnCancel() override { cancelled_ = true; }

  void OnDone() override { delete this; }

 private:
  void Open() {
    if (absl::Status status = OpenSnapshot(); !status.ok()) {
      Finish(ToGrpc(status));
      return;
    }
    const MapRecord& map = snapshot_->map();
    v1::TileStreamHeader& header = *response_.mutable_header();
    header.set_epoch(snapshot_->epoch());
    header.set_voxel_size(map.voxel_size);
    if (map.origin) *header.mutable_origin() = ToProto(*map.origin);
    header.set_crs(map.crs);
    StartWrite(&response_);
  }

  absl::Status OpenSnapshot() {
    if (absl::Status status = CheckName("map name", request_.map()); !status.ok()) return status;
    const std::optional<uint64_t> epoch =
        request_.has_epoch() ? std::optional<uint64_t>(request_.epoch()) : std::nullopt;
    auto snapshot = context_.maps.Open(request_.map(), epoch);
    if (!snapshot.ok()) return snapshot.status();
    snapshot_ = *std::move(snapshot);
    if (request_.has_box()) {
      const auto range = FromProto(request_.box(), snapshot_->map().voxel_size);
      if (!range.ok()) return range.status();
      range_ = *range;
      if (!range_->HasVoxels()) return absl::OkStatus();
    }
    auto tiles = snapshot_->Tiles(range_ ? std::optional(range_->Blocks()) : std::nullopt);
    if (!tiles.ok()) return tiles.status();
    tiles_ = *std::move(tiles);
    return absl::OkStatus();
  }

  // Writes the next block that has something to show, or ends the stream.
  void Next() {
    while (!cancelled_) {
      if (next_block_ == blocks_.size()) {
        if (next_tile_ == tiles_.size()) {
          Finish(grpc::Status::OK);
          return;
        }
        auto blocks = snapshot_->BlocksOf(tiles_[next_tile_++]);
        if (!blocks.ok()) {
          Finish(ToGrpc(blocks.status()));
          return;
        }
        blocks_ = *std::move(blocks);
        next_block_ = 0;
        continue;
      }
      const BlockKey key = blocks_[next_block_++];
      if (range_ && !Touches(key)) continue;
      const auto block = snapshot_->Read(key);
      if (!block.ok()) {
        Finish(ToGrpc(block.status()));
        return;
      }
      auto message = *block == nullptr ? std::nullopt : ToProto(**block, range_, request_.include_all());
      if (!message) continue;
      *response_.mutable_block() = *std::move(message);
      StartWrite(&response_);
      return;
    }
    Finish(grpc::Status(grpc::StatusCode::CANCELLED, "the client went away"));
  }

  bool Touches(BlockKey key) const {
    const auto [first, last] = range_->Blocks();
    const VoxelIndex block = BlockIndexOf(key);
    return first.x <= block.x && block.x <= last.x && first.y <= block.y && block.y <= last.y && first.z <= block.z &&
           block.z <= last.z;
  }

  const ServiceContext context_;
  const v1::StreamTilesRequest request_;
  std::atomic<bool> cancelled_ = false;
  v1::StreamTilesResponse response_;
  std::unique_ptr<Snapshot> snapshot_;
  std::optional<VoxelRange> range_;
  std::vector<TileKey> tiles_;
  std::vector<BlockKey> blocks_;  // of the tile before tiles_[next_tile_]
  size_t next_tile_ = 0, next_block_ = 0;
};

}  // namespace

Reactor* TileService::StreamTiles(grpc::CallbackServerContext* call, const v1::StreamTilesRequest* request) {
  return Admitted<Reactor>(context_.gate, *call, *request,
                           [&](const Call&) { return new TileStream(context_, *request); });
}

}  // namespace mapkeep
