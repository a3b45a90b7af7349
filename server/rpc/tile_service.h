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
  grpc::ServerUnaryReactor* ListTiles(grpc::CallbackServerContext* call, const v1::ListTilesRequest* request,
                                      v1::ListTilesResponse* response) override;
  /// Constant memory: one tile at a time, here and below.
  grpc::ServerWriteReactor<v1::GetTilesResponse>* GetTiles(grpc::CallbackServerContext* call,
                                                           const v1::GetTilesRequest* request) override;
  grpc::ServerWriteReactor<v1::SyncTilesResponse>* SyncTiles(grpc::CallbackServerContext* call,
                                                             const v1::SyncTilesRequest* request) override;
  grpc::ServerWriteReactor<v1::WatchMapResponse>* WatchMap(grpc::CallbackServerContext* call,
                                                           const v1::WatchMapRequest* request) override;

 private:
  const ServiceContext context_;
};

}  // namespace mapkeep
