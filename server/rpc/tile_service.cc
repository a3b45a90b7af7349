#include "server/rpc/tile_service.h"

#include <absl/status/statusor.h>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "server/names.h"
#include "server/rpc/convert.h"
#include "server/rpc/pulled_stream.h"

namespace mapkeep {
namespace {

/// The messages of a StreamTiles call, one after the other.
class BlockSequence {
 public:
  BlockSequence(const ServiceContext& context, v1::StreamTilesRequest request)
      : context_(context), request_(std::move(request)) {}

  absl::StatusOr<Pulled> Next(v1::StreamTilesResponse& message) {
    if (!snapshot_) {
      if (absl::Status status = Open(); !status.ok()) return status;
      const MapRecord& map = snapshot_->map();
      v1::TileStreamHeader& header = *message.mutable_header();
      header.set_epoch(snapshot_->epoch());
      header.set_voxel_size(map.voxel_size);
      if (map.origin) *header.mutable_origin() = ToProto(*map.origin);
      header.set_crs(map.crs);
      return Pulled::kMore;
    }
    if (next_block_ == blocks_.size()) {
      if (next_tile_ == tiles_.size()) return Pulled::kNothing;
      auto blocks = snapshot_->BlocksOf(tiles_[next_tile_++]);
      if (!blocks.ok()) return blocks.status();
      blocks_ = *std::move(blocks);
      next_block_ = 0;
      return Pulled::kNotYet;
    }
    const BlockKey key = blocks_[next_block_++];
    if (range_ && !Touches(key)) return Pulled::kNotYet;
    const auto block = snapshot_->Read(key);
    if (!block.ok()) return block.status();
    auto shown = *block == nullptr ? std::nullopt : ToProto(**block, range_, request_.include_all());
    if (!shown) return Pulled::kNotYet;
    *message.mutable_block() = *std::move(shown);
    return Pulled::kMore;
  }

 private:
  absl::Status Open() {
    if (absl::Status status = CheckName("map name", request_.map()); !status.ok()) return status;
    const std::optional<uint64_t> epoch =
        request_.has_epoch() ? std::optional<uint64_t>(request_.epoch()) : std::nullopt;
    auto snapshot = context_.maps.Open(request_.map(), epoch);
    if (!snapshot.ok()) return snapshot.status();
    if (request_.has_box()) {
      const auto range = FromProto(request_.box(), (*snapshot)->map().voxel_size);
      if (!range.ok()) return range.status();
      range_ = *range;
    }
    if (!range_ || range_->HasVoxels()) {
      auto tiles = (*snapshot)->Tiles(range_ ? std::optional(range_->Blocks()) : std::nullopt);
      if (!tiles.ok()) return tiles.status();
      tiles_ = *std::move(tiles);
    }
    snapshot_ = *std::move(snapshot);
    return absl::OkStatus();
  }

  bool Touches(BlockKey key) const {
    const auto [first, last] = range_->Blocks();
    const VoxelIndex block = BlockIndexOf(key);
    return first.x <= block.x && block.x <= last.x && first.y <= block.y && block.y <= last.y && first.z <= block.z &&
           block.z <= last.z;
  }

  const ServiceContext context_;
  const v1::StreamTilesRequest request_;
  std::unique_ptr<Snapshot> snapshot_;
  std::optional<VoxelRange> range_;
  std::vector<TileKey> tiles_;
  std::vector<BlockKey> blocks_;  // of the tile before tiles_[next_tile_]
  size_t next_tile_ = 0, next_block_ = 0;
};

}  // namespace

grpc::ServerWriteReactor<v1::StreamTilesResponse>* TileService::StreamTiles(grpc::CallbackServerContext* call,
                                                                            const v1::StreamTilesRequest* request) {
  using Reactor = grpc::ServerWriteReactor<v1::StreamTilesResponse>;
  return Admitted<Reactor>(context_.gate, *call, *request, [&](const Call&) {
    auto sequence = std::make_shared<BlockSequence>(context_, *request);
    return PulledStream<v1::StreamTilesResponse>::Start(
        context_.pool, [sequence](v1::StreamTilesResponse& message) { return sequence->Next(message); });
  });
}

}  // namespace mapkeep
