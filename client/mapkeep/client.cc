#include "client/mapkeep/client.h"

#include <string>
#include <utility>

#include "client/mapkeep/connection.h"
#include "client/mapkeep/upload.h"
#include "client/mapkeep/wire.h"

namespace mapkeep {
namespace {

using Maps = v1::MapService::Stub;
using Sessions = v1::SessionService::Stub;

constexpr uint32_t kPageSize = 1000;

template <typename Request>
Request SessionRequest(std::string_view map, std::string_view id) {
  Request request;
  request.set_map(std::string(map));
  request.set_id(std::string(id));
  return request;
}

/// Watches until the session has ended, the stream ends, or `changed` wants to stop (then `stopped` is set); notes what
/// it saw last.
absl::Status WatchOnce(const Connection& connection, const v1::WatchSessionRequest& request,
                       const std::function<bool(const SessionInfo&)>& changed, Patience* patience,
                       std::optional<SessionInfo>* last, bool* stopped) {
  absl::Status reached = connection.WaitForServer();
  if (!reached.ok()) return reached;
  grpc::ClientContext context;
  const auto stream = connection.sessions().WatchSession(&context, request);
  for (v1::WatchSessionResponse response; !*stopped && stream->Read(&response);) {
    patience->Renew();
    *last = FromWire(response.session());
    if (!changed(**last)) {
      *stopped = true;
      context.TryCancel();
    }
  }
  const absl::Status status = connection.StatusOf(stream->Finish());
  return *stopped ? absl::OkStatus() : status;
}

}  // namespace

Client::Client(const ClientOptions& options) : connection_(std::make_unique<Connection>(options)) {}
Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

const ClientOptions& Client::options() const { return connection_->options(); }

absl::StatusOr<MapInfo> Client::CreateMap(const NewMap& map) const {
  v1::CreateMapResponse response;
  const absl::Status status = connection_->Call(connection_->maps(), &Maps::CreateMap, ToWire(map), &response);
  if (!status.ok()) return status;
  return FromWire(response.map());
}

absl::StatusOr<MapInfo> Client::GetMap(std::string_view name) const {
  v1::GetMapRequest request;
  request.set_name(std::string(name));
  v1::GetMapResponse response;
  const absl::Status status = connection_->Call(connection_->maps(), &Maps::GetMap, request, &response);
  if (!status.ok()) return status;
  return FromWire(response.map());
}

absl::StatusOr<std::vector<MapInfo>> Client::ListMaps() const {
  std::vector<MapInfo> maps;
  v1::ListMapsRequest request;
  request.set_page_size(kPageSize);
  do {
    v1::ListMapsResponse response;
    const absl::Status status = connection_->Call(connection_->maps(), &Maps::ListMaps, request, &response);
    if (!status.ok()) return status;
    for (const v1::Map& map : response.maps()) maps.push_back(FromWire(map));
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  return maps;
}

absl::Status Client::DeleteMap(std::string_view name) const {
  v1::DeleteMapRequest request;
  request.set_name(std::string(name));
  v1::DeleteMapResponse response;
  return connection_->Call(connection_->maps(), &Maps::DeleteMap, request, &response);
}

absl::StatusOr<VoxelInfo> Client::QueryVoxel(std::string_view map, const Eigen::Vector3d& point) const {
  v1::QueryVoxelRequest request;
  request.set_map(std::string(map));
  ToWire(point, request.mutable_point());
  v1::QueryVoxelResponse response;
  const absl::Status status = connection_->Call(connection_->maps(), &Maps::QueryVoxel, request, &response);
  if (!status.ok()) return status;
  return FromWire(response);
}

absl::StatusOr<SessionInfo> Client::UploadSession(const SessionUpload& upload,
                                                  const std::function<bool(const UploadProgress&)>& progress) const {
  return mapkeep::UploadSession(*connection_, upload, progress);
}

absl::StatusOr<SessionInfo> Client::GetSession(std::string_view map, std::string_view id) const {
  v1::GetSessionResponse response;
  const absl::Status status = connection_->Call(connection_->sessions(), &Sessions::GetSession,
                                                SessionRequest<v1::GetSessionRequest>(map, id), &response);
  if (!status.ok()) return status;
  return FromWire(response.session());
}

absl::StatusOr<std::vector<SessionInfo>> Client::ListSessions(std::string_view map) const {
  std::vector<SessionInfo> sessions;
  v1::ListSessionsRequest request;
  request.set_map(std::string(map));
  request.set_page_size(kPageSize);
  do {
    v1::ListSessionsResponse response;
    const absl::Status status = connection_->Call(connection_->sessions(), &Sessions::ListSessions, request, &response);
    if (!status.ok()) return status;
    for (const v1::Session& session : response.sessions()) sessions.push_back(FromWire(session));
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  return sessions;
}

absl::StatusOr<SessionInfo> Client::WatchSession(std::string_view map, std::string_view id,
                                                 const std::function<bool(const SessionInfo&)>& changed) const {
  const auto request = SessionRequest<v1::WatchSessionRequest>(map, id);
  Patience patience(connection_->options().patience_seconds);
  std::optional<SessionInfo> last;
  for (bool stopped = false;;) {
    const absl::Status status = WatchOnce(*connection_, request, changed, &patience, &last, &stopped);
    if (stopped || (last.has_value() && HasEnded(last->state))) return *last;
    // A server may end a watch early so that its streams spread anew; and it may be away for a while.
    const bool passing = status.ok() || (absl::IsUnavailable(status) && last.has_value());
    if (!passing) return status;
    if (!patience.Wait()) return status.ok() ? absl::UnavailableError("the server ends every watch at once") : status;
  }
}

absl::StatusOr<SessionInfo> Client::RetrySession(std::string_view map, std::string_view id,
                                                 const std::optional<KnownStart>& start) const {
  auto request = SessionRequest<v1::RetrySessionRequest>(map, id);
  if (start) *request.mutable_initial_pose() = ToWire(*start);
  v1::RetrySessionResponse response;
  const absl::Status status = connection_->Call(connection_->sessions(), &Sessions::RetrySession, request, &response);
  if (!status.ok()) return status;
  return FromWire(response.session());
}

absl::Status Client::DeleteSession(std::string_view map, std::string_view id) const {
  v1::DeleteSessionResponse response;
  return connection_->Call(connection_->sessions(), &Sessions::DeleteSession,
                           SessionRequest<v1::DeleteSessionRequest>(map, id), &response);
}

absl::StatusOr<std::vector<Pose>> Client::ListScanPoses(std::string_view map, std::string_view id) const {
  std::vector<Pose> poses;
  auto request = SessionRequest<v1::ListScanPosesRequest>(map, id);
  for (;;) {
    request.set_first(static_cast<uint32_t>(poses.size()));
    v1::ListScanPosesResponse response;
    const absl::Status status =
        connection_->Call(connection_->sessions(), &Sessions::ListScanPoses, request, &response);
    if (!status.ok()) return status;
    for (const v1::Pose& wire : response.poses()) {
      absl::StatusOr<Pose> pose = FromWire(wire);
      if (!pose.ok()) return pose.status();
      poses.push_back(*pose);
    }
    if (poses.size() >= response.scan_count()) return poses;
    if (response.poses().empty()) return absl::DataLossError("the server sent fewer poses than the session has scans");
  }
}

absl::Status Client::StreamBlocks(const BlockQuery& query, const std::function<absl::Status(const MapSnapshot&)>& begin,
                                  const std::function<absl::Status(const Block&)>& block) const {
  absl::Status status = connection_->WaitForServer();
  if (!status.ok()) return status;
  v1::StreamTilesRequest request;
  request.set_map(query.map);
  request.set_include_all(query.include_all);
  if (query.epoch.has_value()) request.set_epoch(*query.epoch);
  if (query.box.has_value()) ToWire(*query.box, request.mutable_box());

  grpc::ClientContext context;
  const auto stream = connection_->tiles().StreamTiles(&context, request);
  bool begun = false;
  for (v1::StreamTilesResponse response; status.ok() && stream->Read(&response);) {
    if (response.has_header() && !begun) {
      begun = true;
      status = begin(FromWire(response.header()));
    } else if (response.has_block() && begun) {
      absl::StatusOr<Block> received = FromWire(response.block());
      status = received.ok() ? block(*received) : received.status();
    } else {
      status = absl::DataLossError("the server's stream does not begin with one header");
    }
  }
  if (!status.ok()) context.TryCancel();
  const absl::Status finished = connection_->StatusOf(stream->Finish());
  if (!status.ok()) return status;
  if (finished.ok() && !begun) return absl::DataLossError("the server's stream holds no header");
  return finished;
}

}  // namespace mapkeep
