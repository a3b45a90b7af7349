#pragma once

#include "mapkeep/v1/tile_service.grpc.pb.h"
#include "server/rpc/context.h"

namespace mapkeep {

/// Tiles: see proto/mapkeep/v1/tile_service.proto.
class TileService final : public v1::TileService::CallbackService {
 public:
  explicit TileService(const ServiceContext& context) : context_(context) {}

  /// Constant memory: the next block is read from the store when the last one was written.
  grpc::ServerWriteReactor<v1::StreamTilesResponse>* StreamTiles(grpc::CallbackServerContext* call,
                                                                 const v1::StreamTilesRequest* request) override;

 private:
  const ServiceContext context_;
};

}  // namespace mapkeep
