#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/message_lite.h>
#include <grpcpp/support/byte_buffer.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <tuple>

#include "mapkeep/v1/tile_service.pb.h"
#include "storage/byte_cache.h"
#include "storage/map_store.h"

namespace mapkeep {

/// A message as gRPC sends it.
grpc::ByteBuffer BufferOf(const google::protobuf::MessageLite& message);

/// Tiles as GetTiles and SyncTiles send them: made once, kept by what they are made of, and sent to all who ask without
/// being copied or encoded again. Thread-safe.
class TileBuffers {
 public:
  /// `eta` of eq. 4, for the stabilities.
  TileBuffers(size_t cache_bytes, double eta) : eta_(eta), cache_(cache_bytes) {}

  /// GetTilesResponse with `tile` set, which is SyncTilesResponse with `tile` set as well. Reads the store if nobody
  /// asked before; DATA_LOSS as of Snapshot::Read.
  absl::StatusOr<grpc::ByteBuffer> Of(const Snapshot& snapshot, const TileEntry& entry, v1::TileDetail detail);

  CacheUse Use() const { return cache_.Use(); }

 private:
  // The map's incarnation, the tile, and what made its content: never another message.
  using Name = std::tuple<uint64_t, uint64_t, uint64_t, uint64_t, int>;

  const double eta_;
  ByteCache<Name, std::string> cache_;
};

}  // namespace mapkeep
