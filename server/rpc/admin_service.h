#pragma once

#include "mapkeep/v1/admin_service.grpc.pb.h"
#include "server/rpc/context.h"

namespace mapkeep {

/// Upkeep: see proto/mapkeep/v1/admin_service.proto.
class AdminService final : public v1::AdminService::CallbackService {
 public:
  explicit AdminService(const ServiceContext& context) : context_(context) {}

  grpc::ServerUnaryReactor* VerifyMap(grpc::CallbackServerContext* call, const v1::VerifyMapRequest* request,
                                      v1::VerifyMapResponse* response) override;
  grpc::ServerUnaryReactor* CollectGarbage(grpc::CallbackServerContext* call, const v1::CollectGarbageRequest* request,
                                           v1::CollectGarbageResponse* response) override;
  grpc::ServerUnaryReactor* Backup(grpc::CallbackServerContext* call, const v1::BackupRequest* request,
                                   v1::BackupResponse* response) override;
  grpc::ServerUnaryReactor* Restore(grpc::CallbackServerContext* call, const v1::RestoreRequest* request,
                                    v1::RestoreResponse* response) override;
  grpc::ServerUnaryReactor* ReplayMap(grpc::CallbackServerContext* call, const v1::ReplayMapRequest* request,
                                      v1::ReplayMapResponse* response) override;

 private:
  absl::Status Verify(const v1::VerifyMapRequest& request, v1::VerifyMapResponse& response, const Progress& progress);
  absl::Status Collect(const v1::CollectGarbageRequest& request, v1::CollectGarbageResponse& response,
                       const Progress& progress);
  absl::Status MakeBackup(const v1::BackupRequest& request, v1::BackupResponse& response);
  absl::Status TakeBackup(const v1::RestoreRequest& request, v1::RestoreResponse& response, const Progress& progress);
  absl::Status Replay(const v1::ReplayMapRequest& request, v1::ReplayMapResponse& response, const Progress& progress);

  const ServiceContext context_;
};

}  // namespace mapkeep
