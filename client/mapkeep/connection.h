#pragma once

#include <absl/status/status.h>
#include <absl/time/time.h>
#include <grpcpp/grpcpp.h>

#include <memory>
#include <string_view>
#include <utility>

#include "client/mapkeep/client.h"
#include "client/mapkeep/patience.h"
#include "mapkeep/v1/admin_service.grpc.pb.h"
#include "mapkeep/v1/localization_service.grpc.pb.h"
#include "mapkeep/v1/map_service.grpc.pb.h"
#include "mapkeep/v1/session_service.grpc.pb.h"
#include "mapkeep/v1/tile_service.grpc.pb.h"

namespace mapkeep {

/// Channel and stubs of one client.
class Connection {
 public:
  explicit Connection(const ClientOptions& options);

  const ClientOptions& options() const { return options_; }
  v1::AdminService::Stub& admin() const { return *admin_; }
  v1::MapService::Stub& maps() const { return *maps_; }
  v1::SessionService::Stub& sessions() const { return *sessions_; }
  v1::TileService::Stub& tiles() const { return *tiles_; }
  v1::LocalizationService::Stub& localization() const { return *localization_; }

  /// Waits up to connect_seconds for the server. UNAVAILABLE naming its address, or what is wrong with the credentials.
  absl::Status WaitForServer() const;

  /// The server's code and message.
  absl::Status StatusOf(const grpc::Status& status) const;

  /// One unary call with a deadline, once the server is there.
  template <typename Stub, typename Request, typename Response>
  absl::Status Call(Stub& stub, grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                    const Request& request, Response* response, absl::Duration timeout = kCallTimeout) const {
    absl::Status reached = WaitForServer();
    if (!reached.ok()) return reached;
    grpc::ClientContext context;
    context.set_deadline(absl::ToChronoTime(absl::Now() + timeout));
    return StatusOf((stub.*method)(&context, request, response));
  }

 private:
  static constexpr absl::Duration kCallTimeout = absl::Minutes(2);

  ClientOptions options_;
  absl::Status usable_;  ///< what CheckCredentials says of the options
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::AdminService::Stub> admin_;
  std::unique_ptr<v1::MapService::Stub> maps_;
  std::unique_ptr<v1::SessionService::Stub> sessions_;
  std::unique_ptr<v1::TileService::Stub> tiles_;
  std::unique_ptr<v1::LocalizationService::Stub> localization_;
};

}  // namespace mapkeep
