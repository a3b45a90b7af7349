#include "server/rpc/rpc_server.h"

#include <absl/strings/str_format.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/resource_quota.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "server/rpc/admin_service.h"
#include "server/rpc/call_observer.h"
#include "server/rpc/credentials.h"
#include "server/rpc/localization_service.h"
#include "server/rpc/map_service.h"
#include "server/rpc/session_service.h"
#include "server/rpc/tile_service.h"
#include "server/rpc/upload_slots.h"

namespace mapkeep {
namespace {

constexpr int kLargestMessage = 8 << 20;
constexpr int kLargestFrame = 1 << 20;  // a chunk of a scan then comes in few pieces
// A peer on a busy machine may need as long to say that it is there.
constexpr int kShortestAnswerMilliseconds = 5000;
// Of one connection; proxies put many clients on one, and open another when it is full.
constexpr int kMostStreams = 1024;

}  // namespace

struct RpcServer::Services {
  explicit Services(const ServiceContext& given)
      : context(given), admin(given), maps(given), sessions(given, uploads), tiles(given), localization(given) {}

  const ServiceContext context;
  UploadSlots uploads;
  AdminService admin;
  MapService maps;
  SessionService sessions;
  TileService tiles;
  LocalizationService localization;
  std::unique_ptr<grpc::Server> server;
};

RpcServer::RpcServer() = default;

absl::StatusOr<std::unique_ptr<RpcServer>> RpcServer::Start(const Endpoint& endpoint, const ServiceContext& context) {
  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  std::unique_ptr<RpcServer> rpc(new RpcServer);
  rpc->services_ = std::make_unique<Services>(context);
  Services& services = *rpc->services_;

  const Limits& limits = context.config.limits;
  grpc::ServerBuilder builder;
  builder.SetMaxReceiveMessageSize(kLargestMessage);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_FRAME_SIZE, kLargestFrame);
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);  // a taken port is an error, not a share
  // Finds clients that vanished without a word, and bears clients that do the same.
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 1000 * limits.keepalive_seconds);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS,
                             std::max(kShortestAnswerMilliseconds, 500 * limits.keepalive_seconds));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 10000);
  builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, 1000 * limits.handshake_seconds);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, kMostStreams);
  // Under pressure gRPC reads less from everybody instead of growing.
  grpc::ResourceQuota memory("mapkeepd");
  memory.Resize(static_cast<size_t>(limits.rpc_memory_mib) << 20);
  builder.SetResourceQuota(memory);
  builder.AddListeningPort(ToString(endpoint), ServerCredentialsOf(context.config.security), &rpc->port_);
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> observers;
  observers.push_back(NewCallObserver(context.metrics));
  builder.experimental().SetInterceptorCreators(std::move(observers));
  builder.RegisterService(&services.admin);
  builder.RegisterService(&services.maps);
  builder.RegisterService(&services.sessions);
  builder.RegisterService(&services.tiles);
  builder.RegisterService(&services.localization);
  services.server = builder.BuildAndStart();
  if (services.server == nullptr || rpc->port_ == 0) {
    return absl::UnavailableError(
        absl::StrFormat("cannot listen on --listen %s: is the port taken?", ToString(endpoint)));
  }
  rpc->SetServing(false);
  return rpc;
}

RpcServer::~RpcServer() {
  if (services_ != nullptr && services_->server != nullptr) Shutdown(std::chrono::seconds(0));
}

size_t RpcServer::uploads() const { return services_->uploads.size(); }

CacheUse RpcServer::tile_cache() const { return services_->tiles.buffer_use(); }

void RpcServer::SetServing(bool serving) {
  if (auto* health = services_->server->GetHealthCheckService()) health->SetServingStatus(serving);
}

void RpcServer::Shutdown(std::chrono::seconds patience) {
  services_->uploads.Close();
  services_->context.feed.Close();
  services_->context.epochs.Close();
  services_->server->Shutdown(std::chrono::system_clock::now() + patience);
  services_->server->Wait();
}

}  // namespace mapkeep
