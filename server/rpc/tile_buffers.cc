#include "server/rpc/tile_buffers.h"

#include <memory>
#include <utility>

#include "server/rpc/tile_message.h"

namespace mapkeep {
namespace {

static_assert(int{v1::GetTilesResponse::kTileFieldNumber} == int{v1::SyncTilesResponse::kTileFieldNumber},
              "one message serves both calls");

using SharedMessage = std::shared_ptr<const std::string>;

// As long as gRPC has it, the message is held.
grpc::ByteBuffer Share(const SharedMessage& message) {
  // gRPC only reads what a slice refers to.
  auto* const bytes = const_cast<char*>(message->data());
  const grpc::Slice slice(
      bytes, message->size(), [](void* held) { delete static_cast<SharedMessage*>(held); }, new SharedMessage(message));
  return {&slice, 1};
}

}  // namespace

grpc::ByteBuffer BufferOf(const google::protobuf::MessageLite& message) {
  return Share(std::make_shared<const std::string>(message.SerializeAsString()));
}

absl::StatusOr<grpc::ByteBuffer> TileBuffers::Of(const Snapshot& snapshot, const TileEntry& entry,
                                                 v1::TileDetail detail) {
  const bool masks = detail == v1::TILE_DETAIL_SUB_VOXELS;
  const Name name{snapshot.map().incarnation, static_cast<uint64_t>(entry.key), entry.version.attempt,
                  entry.version.round, masks ? 1 : 0};
  if (const SharedMessage known = cache_.Find(name)) return Share(known);
  absl::StatusOr<v1::MapTile> tile = MakeTile(snapshot, entry, detail, eta_);
  if (!tile.ok()) return tile.status();
  v1::GetTilesResponse response;
  *response.mutable_tile() = *std::move(tile);
  auto message = std::make_shared<const std::string>(response.SerializeAsString());
  cache_.Insert(name, message, message->size());
  return Share(message);
}

}  // namespace mapkeep
