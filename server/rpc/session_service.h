#pragma once

#include "mapkeep/v1/session_service.grpc.pb.h"
#include "server/rpc/context.h"
#include "server/rpc/upload_slots.h"

namespace mapkeep {

/// What the calls of SessionService are on the wire: messages that gRPC decodes, and for uploads their bytes, which
/// threads that give way decode.
using SessionCalls = v1::SessionService::WithCallbackMethod_BeginSession<
    v1::SessionService::WithRawCallbackMethod_UploadScans<v1::SessionService::WithCallbackMethod_CommitSession<
        v1::SessionService::WithCallbackMethod_GetSession<v1::SessionService::WithCallbackMethod_ListSessions<
            v1::SessionService::WithCallbackMethod_WatchSession<v1::SessionService::WithCallbackMethod_RetrySession<
                v1::SessionService::WithCallbackMethod_DeleteSession<
                    v1::SessionService::WithCallbackMethod_ListScanPoses<v1::SessionService::Service>>>>>>>>>;

/// Sessions: see proto/mapkeep/v1/session_service.proto.
class SessionService final : public SessionCalls {
 public:
  SessionService(const ServiceContext& context, UploadSlots& uploads) : context_(context), uploads_(uploads) {}

  grpc::ServerUnaryReactor* BeginSession(grpc::CallbackServerContext* call, const v1::BeginSessionRequest* request,
                                         v1::BeginSessionResponse* response) override;
  /// Of UploadScansRequest and UploadScansResponse.
  grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* UploadScans(grpc::CallbackServerContext* call) override;
  grpc::ServerUnaryReactor* CommitSession(grpc::CallbackServerContext* call, const v1::CommitSessionRequest* request,
                                          v1::CommitSessionResponse* response) override;
  grpc::ServerUnaryReactor* GetSession(grpc::CallbackServerContext* call, const v1::GetSessionRequest* request,
                                       v1::GetSessionResponse* response) override;
  grpc::ServerUnaryReactor* ListSessions(grpc::CallbackServerContext* call, const v1::ListSessionsRequest* request,
                                         v1::ListSessionsResponse* response) override;
  grpc::ServerWriteReactor<v1::WatchSessionResponse>* WatchSession(grpc::CallbackServerContext* call,
                                                                   const v1::WatchSessionRequest* request) override;
  grpc::ServerUnaryReactor* RetrySession(grpc::CallbackServerContext* call, const v1::RetrySessionRequest* request,
                                         v1::RetrySessionResponse* response) override;
  grpc::ServerUnaryReactor* DeleteSession(grpc::CallbackServerContext* call, const v1::DeleteSessionRequest* request,
                                          v1::DeleteSessionResponse* response) override;
  grpc::ServerUnaryReactor* ListScanPoses(grpc::CallbackServerContext* call, const v1::ListScanPosesRequest* request,
                                          v1::ListScanPosesResponse* response) override;

 private:
  absl::Status Begin(const Call& call, const v1::BeginSessionRequest& request, v1::BeginSessionResponse& response);
  absl::Status Commit(const Call& call, const v1::CommitSessionRequest& request, v1::CommitSessionResponse& response);
  absl::Status Retry(const Call& call, const v1::RetrySessionRequest& request, v1::RetrySessionResponse& response);
  absl::Status List(const v1::ListSessionsRequest& request, v1::ListSessionsResponse& response);
  absl::Status ListPoses(const Call& call, const v1::ListScanPosesRequest& request,
                         v1::ListScanPosesResponse& response);

  const ServiceContext context_;
  UploadSlots& uploads_;
};

}  // namespace mapkeep
