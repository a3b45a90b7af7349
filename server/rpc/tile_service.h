#pragma once

#include "mapkeep/v1/tile_service.grpc.pb.h"
#include "server/rpc/context.h"
#include "server/rpc/tile_buffers.h"

namespace mapkeep {

/// What the calls of TileService are on the wire: messages that gRPC encodes, and for whole tiles bytes that were
/// encoded before.
using TileCalls = v1::TileService::WithCallbackMethod_StreamTiles<v1::TileService::WithCallbackMethod_ListTiles<
    v1::TileService::WithRawCallbackMethod_GetTiles<v1::TileService::WithRawCallbackMethod_SyncTiles<
        v1::TileService::WithCallbackMethod_WatchMap<v1::TileService::Service>>>>>;

/// Tiles: see proto/mapkeep/v1/tile_service.proto.
class TileService final : public TileCalls {
 public:
  explicit TileService(const ServiceContext& context)
      : context_(context),
        buffers_(static_cast<size_t>(context.config.pages.cache_mib) << 19, context.config.stages.filter.eta) {}

  CacheUse buffer_use() const { return buffers_.Use(); }

  /// Constant memory: the next block is read from the store while the last one is written.
  grpc::ServerWriteReactor<v1::StreamTilesResponse>* StreamTiles(grpc::CallbackServerContext* call,
                                                                 const v1::StreamTilesRequest* request) override;
  grpc::ServerUnaryReactor* ListTiles(grpc::CallbackServerContext* call, const v1::ListTilesRequest* request,
                                      v1::ListTilesResponse* response) override;
  /// Constant memory: two tiles at a time, here and below. Streams of GetTilesResponse and SyncTilesResponse.
  grpc::ServerWriteReactor<grpc::ByteBuffer>* GetTiles(grpc::CallbackServerContext* call,
                                                       const grpc::ByteBuffer* request) override;
  grpc::ServerWriteReactor<grpc::ByteBuffer>* SyncTiles(grpc::CallbackServerContext* call,
                                                        const grpc::ByteBuffer* request) override;
  grpc::ServerWriteReactor<v1::WatchMapResponse>* WatchMap(grpc::CallbackServerContext* call,
                                                           const v1::WatchMapRequest* request) override;

 private:
  const ServiceContext context_;
  TileBuffers buffers_;
};

}  // namespace mapkeep
