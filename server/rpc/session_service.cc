#include "server/rpc/session_service.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <shared_mutex>
#include <string>

#include "core/registration/session_search.h"
#include "server/log.h"
#include "server/names.h"
#include "server/rpc/answer.h"
#include "server/rpc/convert.h"
#include "server/rpc/paging.h"
#include "server/rpc/sessions.h"
#include "server/rpc/upload.h"
#include "server/rpc/watch.h"
#include "storage/clock.h"

namespace mapkeep {
namespace {

constexpr uint32_t kMostPoses = 10000;
constexpr int kCommitTries = 10;

v1::Session Described(const ServiceContext& context, const SessionRecord& session) {
  return ToProto(session, context.feed.Progress({session.map, session.id}));
}

absl::StatusOr<std::array<double, 4>> InitialPoseOf(const v1::InitialPose& given) {
  const v1::Point& at = given.position();
  const std::array<double, 4> pose{at.x(), at.y(), at.z(), given.yaw()};
  if (!std::ranges::all_of(pose, [](double value) { return std::isfinite(value); })) {
    return absl::InvalidArgumentError("initial_pose: expected finite numbers");
  }
  return pose;
}

absl::StatusOr<std::array<double, 12>> GnssOf(const v1::GnssPosition& given, const MapRecord& map) {
  if (map.crs.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("gnss: map ", map.name, " has no CRS; give one when the map is made, or an initial pose instead"));
  }
  if (given.covariance_size() != 9) {
    return absl::InvalidArgumentError(
        absl::StrFormat("gnss.covariance: has %d values, expected 9 (3x3)", given.covariance_size()));
  }
  std::array<double, 12> gnss{given.position().x(), given.position().y(), given.position().z()};
  std::copy(given.covariance().begin(), given.covariance().end(), gnss.begin() + 3);
  if (!std::ranges::all_of(gnss, [](double value) { return std::isfinite(value); })) {
    return absl::InvalidArgumentError("gnss: expected finite numbers");
  }
  if (!IsCovariance(Eigen::Map<const Eigen::Matrix3d>(gnss.data() + 3))) {
    return absl::InvalidArgumentError("gnss.covariance: expected a symmetric matrix with positive eigenvalues");
  }
  return gnss;
}

}  // namespace

grpc::ServerUnaryReactor* SessionService::BeginSession(grpc::CallbackServerContext* call,
                                                       const v1::BeginSessionRequest* request,
                                                       v1::BeginSessionResponse* response) {
  return Answer(call, context_, *request, [=, this](const Call& of) { return Begin(of, *request, *response); });
}

grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* SessionService::UploadScans(
    grpc::CallbackServerContext* call) {
  using Reactor = grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>;
  return Admitted<Reactor>(context_.gate, *call, v1::UploadScansRequest(),
                           [&](Call of) { return NewUpload(context_, *call, std::move(of), uploads_); });
}

grpc::ServerUnaryReactor* SessionService::CommitSession(grpc::CallbackServerContext* call,
                                                        const v1::CommitSessionRequest* request,
                                                        v1::CommitSessionResponse* response) {
  return Answer(call, context_, *request, [=, this](const Call& of) { return Commit(of, *request, *response); });
}

grpc::ServerUnaryReactor* SessionService::GetSession(grpc::CallbackServerContext* call,
                                                     const v1::GetSessionRequest* request,
                                                     v1::GetSessionResponse* response) {
  return Answer(call, context_, *request, [=, this](const Call& of) -> absl::Status {
    const auto session = FindSession(context_, of, Access::kFollow, request->map(), request->id());
    if (!session.ok()) return session.status();
    *response->mutable_session() = Described(context_, *session);
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* SessionService::ListSessions(grpc::CallbackServerContext* call,
                                                       const v1::ListSessionsRequest* request,
                                                       v1::ListSessionsResponse* response) {
  return Answer(call, context_, *request, [=, this] { return List(*request, *response); });
}

grpc::ServerWriteReactor<v1::WatchSessionResponse>* SessionService::WatchSession(
    grpc::CallbackServerContext* call, const v1::WatchSessionRequest* request) {
  return Admitted<grpc::ServerWriteReactor<v1::WatchSessionResponse>>(
      context_.gate, *call, *request, [this](Call of) { return NewWatch(context_, std::move(of)); });
}

grpc::ServerUnaryReactor* SessionService::RetrySession(grpc::CallbackServerContext* call,
                                                       const v1::RetrySessionRequest* request,
                                                       v1::RetrySessionResponse* response) {
  return Answer(call, context_, *request, [=, this](const Call& of) { return Retry(of, *request, *response); });
}

grpc::ServerUnaryReactor* SessionService::DeleteSession(grpc::CallbackServerContext* call,
                                                        const v1::DeleteSessionRequest* request,
                                                        v1::DeleteSessionResponse*) {
  return Answer(call, context_, *request, [=, this]() -> absl::Status {
    const auto session = FindSession(context_, request->map(), request->id());
    if (!session.ok()) return session.status();
    if (absl::Status status = context_.sessions.Delete(request->map(), request->id()); !status.ok()) return status;
    context_.quotas.Forget(request->map(), request->id());
    context_.feed.Changed({request->map(), request->id()});
    LogInfo("session deleted", {{"map", request->map()}, {"session", request->id()}});
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* SessionService::ListScanPoses(grpc::CallbackServerContext* call,
                                                        const v1::ListScanPosesRequest* request,
                                                        v1::ListScanPosesResponse* response) {
  return Answer(call, context_, *request, [=, this](const Call& of) { return ListPoses(of, *request, *response); });
}

absl::Status SessionService::Begin(const Call& call, const v1::BeginSessionRequest& request,
                                   v1::BeginSessionResponse& response) {
  if (absl::Status status = CheckName("map name", request.map()); !status.ok()) return status;
  if (absl::Status status = CheckName("session id", request.id()); !status.ok()) return status;
  if (absl::Status status = CheckOptionalName("robot", request.robot()); !status.ok()) return status;
  // A robot's sessions are those of its token's name, which it need not say.
  const Caller& caller = call.caller;
  const bool names_itself = request.robot().empty() && caller.Has(Role::kRobot);
  const std::string robot = names_itself ? caller.name : request.robot();
  if (absl::Status status = AllowSession(caller, Access::kUpload, robot); !status.ok()) return status;
  if (request.scan_crc32c().empty()) {
    return absl::InvalidArgumentError("scan_crc32c: expected one checksum a scan, at least one");
  }
  const std::shared_lock map_stays(context_.map_lifetimes);
  const absl::StatusOr<MapRecord> map = context_.maps.Find(request.map());
  if (!map.ok()) return map.status();
  SessionRecord record{.map = request.map(),
                       .id = request.id(),
                       .robot = robot,
                       .keep_scans = request.keep_scans() || context_.config.history.keep_scans,
                       .created = SystemSeconds()};
  record.scan_crc32c.assign(request.scan_crc32c().begin(), request.scan_crc32c().end());
  if (request.has_initial_pose()) {
    const auto pose = InitialPoseOf(request.initial_pose());
    if (!pose.ok()) return pose.status();
    record.initial_pose = *pose;
  }
  if (request.has_gnss()) {
    const auto gnss = GnssOf(request.gnss(), *map);
    if (!gnss.ok()) return gnss.status();
    record.gnss = *gnss;
  }
  if (absl::Status status = context_.quotas.Begin(record.map, record.id, record.robot); !status.ok()) {
    // One that is there already needs no room.
    if (!context_.sessions.Find(record.map, record.id).ok()) return status;
  }
  const auto session = context_.sessions.Begin(record);
  if (!session.ok()) {
    const auto other = context_.sessions.Find(record.map, record.id);
    other.ok() ? context_.quotas.Note(*other) : context_.quotas.Forget(record.map, record.id);
    return session.status();
  }
  context_.quotas.Note(*session);
  // The same id and content may have been begun by another robot.
  if (absl::Status status = AllowSession(caller, Access::kUpload, session->robot); !status.ok()) return status;
  LogInfo("session begun", {{"map", session->map},
                            {"session", session->id},
                            {"robot", session->robot},
                            {"scans", session->scan_crc32c.size()},
                            {"durable", session->durable_scans}});
  *response.mutable_session() = Described(context_, *session);
  return absl::OkStatus();
}

absl::Status SessionService::Commit(const Call& call, const v1::CommitSessionRequest& request,
                                    v1::CommitSessionResponse& response) {
  // Each failed try means that somebody else moved the session on meanwhile.
  for (int tries = 0; tries < kCommitTries; ++tries) {
    auto session = FindSession(context_, call, Access::kUpload, request.map(), request.id());
    if (!session.ok()) return session.status();
    if (session->state == SessionState::kUploading) {
      if (session->durable_scans != session->scan_crc32c.size()) {
        return absl::FailedPreconditionError(absl::StrFormat("session %s has %d of %d scans", session->id,
                                                             session->durable_scans, session->scan_crc32c.size()));
      }
      const auto first = context_.sessions.ReadScan(session->map, session->id, 0);
      if (!first.ok()) return first.status();
      if (absl::Status status = context_.quotas.Queue(*session); !status.ok()) return status;
      session->start_time = CountsFrom1970(first->scan.time) ? first->scan.time : session->created;
      session->state = SessionState::kQueued;
      const absl::Status queued = context_.sessions.Update(*session, SessionState::kUploading);
      if (absl::IsAborted(queued)) continue;
      if (!queued.ok()) return queued;
      LogInfo("session queued", {{"map", session->map}, {"session", session->id}});
      context_.feed.Changed({session->map, session->id});
      session = FindSession(context_, request.map(), request.id());  // with its turn
      if (!session.ok()) return session.status();
    }
    if (!HasEnded(session->state)) context_.pipeline.Push(*session);
    *response.mutable_session() = Described(context_, *session);
    return absl::OkStatus();
  }
  return absl::AbortedError(absl::StrCat("session ", request.id(), " keeps changing; try again"));
}

absl::Status SessionService::Retry(const Call& call, const v1::RetrySessionRequest& request,
                                   v1::RetrySessionResponse& response) {
  auto session = FindSession(context_, call, Access::kUpload, request.map(), request.id());
  if (!session.ok()) return session.status();
  const SessionState before = session->state;
  if (before != SessionState::kRefused && before != SessionState::kFailed) {
    return absl::FailedPreconditionError(
        absl::StrCat("session ", session->id, " is neither refused nor failed: there is nothing to try again"));
  }
  if (session->scans_deleted) {
    return absl::FailedPreconditionError(absl::StrCat("the scans of session ", session->id, " are gone"));
  }
  if (request.has_initial_pose()) {
    const auto pose = InitialPoseOf(request.initial_pose());
    if (!pose.ok()) return pose.status();
    session->initial_pose = *pose;
  }
  if (absl::Status status = context_.quotas.Queue(*session); !status.ok()) return status;
  session->state = SessionState::kQueued;
  session->reason.clear();
  session->ended = 0;
  if (absl::Status status = context_.sessions.Update(*session, before); !status.ok()) {
    context_.quotas.Forget(session->map, session->id);
    return status;
  }
  LogInfo("session queued again", {{"map", session->map}, {"session", session->id}});
  context_.feed.Changed({session->map, session->id});
  session = FindSession(context_, request.map(), request.id());  // with its new turn
  if (!session.ok()) return session.status();
  context_.pipeline.Push(*session);
  *response.mutable_session() = Described(context_, *session);
  return absl::OkStatus();
}

absl::Status SessionService::List(const v1::ListSessionsRequest& request, v1::ListSessionsResponse& response) {
  if (absl::Status status = CheckName("map name", request.map()); !status.ok()) return status;
  if (absl::Status status = context_.maps.Find(request.map()).status(); !status.ok()) return status;
  const auto after = PositionOf(request.page_token());
  if (!after.ok()) return after.status();
  const auto page = context_.sessions.List(request.map(), *after, PageSize(request.page_size()));
  if (!page.ok()) return page.status();
  for (const SessionRecord& session : page->sessions) *response.add_sessions() = Described(context_, session);
  if (!page->next.empty()) response.set_next_page_token(PageToken(page->next));
  return absl::OkStatus();
}

absl::Status SessionService::ListPoses(const Call& call, const v1::ListScanPosesRequest& request,
                                       v1::ListScanPosesResponse& response) {
  const auto session = FindSession(context_, call, Access::kFollow, request.map(), request.id());
  if (!session.ok()) return session.status();
  if (session->state != SessionState::kCommitted) {
    return absl::FailedPreconditionError(absl::StrCat("session ", session->id, " is not committed"));
  }
  const auto poses = context_.sessions.ReadPoses(request.map(), request.id());
  if (!poses.ok()) return poses.status();
  const size_t size = request.page_size() == 0 ? kMostPoses : std::min(request.page_size(), kMostPoses);
  const size_t end = std::min(poses->size(), request.first() + size);
  for (size_t i = request.first(); i < end; ++i) *response.add_poses() = ToProto((*poses)[i]);
  response.set_scan_count(static_cast<uint32_t>(poses->size()));
  return absl::OkStatus();
}

}  // namespace mapkeep
