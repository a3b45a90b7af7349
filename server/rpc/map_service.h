#pragma once

#include "mapkeep/v1/map_service.grpc.pb.h"
#include "server/rpc/context.h"

namespace mapkeep {

/// The map that a request describes, with the defaults filled in. INVALID_ARGUMENT naming the field.
absl::StatusOr<MapRecord> NewMapRecord(const v1::CreateMapRequest& request);

/// Maps: see proto/mapkeep/v1/map_service.proto.
class MapService final : public v1::MapService::CallbackService {
 public:
  explicit MapService(const ServiceContext& context) : context_(context) {}

  grpc::ServerUnaryReactor* CreateMap(grpc::CallbackServerContext* call, const v1::CreateMapRequest* request,
                                      v1::CreateMapResponse* response) override;
  grpc::ServerUnaryReactor* GetMap(grpc::CallbackServerContext* call, const v1::GetMapRequest* request,
                                   v1::GetMapResponse* response) override;
  grpc::ServerUnaryReactor* ListMaps(grpc::CallbackServerContext* call, const v1::ListMapsRequest* request,
                                     v1::ListMapsResponse* response) override;
  grpc::ServerUnaryReactor* DeleteMap(grpc::CallbackServerContext* call, const v1::DeleteMapRequest* request,
                                      v1::DeleteMapResponse* response) override;
  grpc::ServerUnaryReactor* QueryVoxel(grpc::CallbackServerContext* call, const v1::QueryVoxelRequest* request,
                                       v1::QueryVoxelResponse* response) override;
  grpc::ServerUnaryReactor* ListVersions(grpc::CallbackServerContext* call, const v1::ListVersionsRequest* request,
                                         v1::ListVersionsResponse* response) override;
  grpc::ServerUnaryReactor* AddTag(grpc::CallbackServerContext* call, const v1::AddTagRequest* request,
                                   v1::AddTagResponse* response) override;
  grpc::ServerUnaryReactor* RemoveTag(grpc::CallbackServerContext* call, const v1::RemoveTagRequest* request,
                                      v1::RemoveTagResponse* response) override;
  grpc::ServerUnaryReactor* RollBackMap(grpc::CallbackServerContext* call, const v1::RollBackMapRequest* request,
                                        v1::RollBackMapResponse* response) override;
  grpc::ServerWriteReactor<v1::CompareEpochsResponse>* CompareEpochs(grpc::CallbackServerContext* call,
                                                                     const v1::CompareEpochsRequest* request) override;

  grpc::ServerReadReactor<v1::ImportMapRequest>* ImportMap(grpc::CallbackServerContext* call,
                                                           v1::ImportMapResponse* response) override;

 private:
  absl::Status Create(const v1::CreateMapRequest& request, v1::CreateMapResponse& response);
  absl::Status List(const Call& call, const v1::ListMapsRequest& request, v1::ListMapsResponse& response);
  absl::Status Delete(const v1::DeleteMapRequest& request);
  absl::Status Versions(const v1::ListVersionsRequest& request, v1::ListVersionsResponse& response);
  absl::Status RollBack(const v1::RollBackMapRequest& request, v1::RollBackMapResponse& response);
  absl::Status Query(const v1::QueryVoxelRequest& request, v1::QueryVoxelResponse& response);

  const ServiceContext context_;
};

}  // namespace mapkeep
