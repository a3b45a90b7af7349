#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

#include "server/log.h"
#include "server/names.h"
#include "server/rpc/answer.h"
#include "server/rpc/convert.h"
#include "server/rpc/epoch_comparison.h"
#include "server/rpc/map_import.h"
#include "server/rpc/map_service.h"
#include "server/rpc/paging.h"
#include "storage/rolled_back_sessions.h"

namespace mapkeep {
grpc::ServerUnaryReactor* MapService::ListVersions(grpc::CallbackServerContext* call,
                                                   const v1::ListVersionsRequest* request,
                                                   v1::ListVersionsResponse* response) {
  return Answer(call, context_, *request, [=, this] { return Versions(*request, *response); });
}

grpc::ServerUnaryReactor* MapService::AddTag(grpc::CallbackServerContext* call, const v1::AddTagRequest* request,
                                             v1::AddTagResponse* response) {
  return Answer(call, context_, *request, [=, this]() -> absl::Status {
    if (absl::Status status = CheckName("map name", request->map()); !status.ok()) return status;
    if (absl::Status status = CheckName("tag", request->tag()); !status.ok()) return status;
    const auto tag = context_.maps.AddTag(request->map(), request->tag(),
                                          request->has_epoch() ? std::optional(request->epoch()) : std::nullopt);
    if (!tag.ok()) return tag.status();
    response->set_epoch(tag->epoch);
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* MapService::RemoveTag(grpc::CallbackServerContext* call, const v1::RemoveTagRequest* request,
                                                v1::RemoveTagResponse*) {
  return Answer(call, context_, *request, [=, this]() -> absl::Status {
    if (absl::Status status = CheckName("map name", request->map()); !status.ok()) return status;
    return context_.maps.RemoveTag(request->map(), request->tag());
  });
}

grpc::ServerUnaryReactor* MapService::RollBackMap(grpc::CallbackServerContext* call,
                                                  const v1::RollBackMapRequest* request,
                                                  v1::RollBackMapResponse* response) {
  return Answer(call, context_, *request, [=, this] { return RollBack(*request, *response); });
}

grpc::ServerWriteReactor<v1::CompareEpochsResponse>* MapService::CompareEpochs(
    grpc::CallbackServerContext* call, const v1::CompareEpochsRequest* request) {
  return Admitted<grpc::ServerWriteReactor<v1::CompareEpochsResponse>>(
      context_.gate, *call, *request, [&](const Call&) { return NewEpochComparison(context_, *request); });
}

grpc::ServerReadReactor<v1::ImportMapRequest>* MapService::ImportMap(grpc::CallbackServerContext* call,
                                                                     v1::ImportMapResponse* response) {
  return Admitted<grpc::ServerReadReactor<v1::ImportMapRequest>>(
      context_.gate, *call, v1::ImportMapRequest(),
      [&](Call admitted) { return NewMapImport(context_, std::move(admitted), response); });
}

absl::Status MapService::Versions(const v1::ListVersionsRequest& request, v1::ListVersionsResponse& response) {
  if (absl::Status status = CheckName("map name", request.map()); !status.ok()) return status;
  const auto position = PositionOf(request.page_token());
  if (!position.ok()) return position.status();
  std::optional<uint64_t> newest;
  if (!position->empty()) {
    uint64_t epoch = 0;
    if (!absl::SimpleAtoi(*position, &epoch)) {
      return absl::InvalidArgumentError("page_token: expected one from an earlier answer");
    }
    newest = epoch;
  }
  const auto versions = context_.maps.Versions(request.map(), newest, PageSize(request.page_size()));
  if (!versions.ok()) return versions.status();
  for (const MapVersion& version : *versions) *response.add_versions() = ToProto(version);
  const uint64_t last = versions->back().commit.epoch;
  if (last > 0) response.set_next_page_token(PageToken(absl::StrCat(last - 1)));
  return absl::OkStatus();
}

absl::Status MapService::RollBack(const v1::RollBackMapRequest& request, v1::RollBackMapResponse& response) {
  if (absl::Status status = CheckName("map name", request.map()); !status.ok()) return status;
  const auto rolled = context_.maps.Rollback(request.map(), request.epoch());
  if (!rolled.ok()) return rolled.status();
  LogInfo("map rolled back", {{"map", request.map()},
                              {"to", request.epoch()},
                              {"epoch", rolled->commit.epoch},
                              {"sessions", rolled->withdrawn.size()}});
  response.set_epoch(rolled->commit.epoch);
  for (const std::string& session : rolled->withdrawn) response.add_rolled_back(session);
  for (const std::string& session : rolled->revived) response.add_brought_back(session);
  // The rollback has happened, whatever becomes of this: housekeeping does it again.
  const auto settled = SettleSessions(context_.engine, context_.sessions, request.map());
  if (!settled.ok())
    LogWarning("sessions not marked yet", {{"map", request.map()}, {"why", settled.status().ToString()}});
  for (const auto* sessions : {&rolled->withdrawn, &rolled->revived}) {
    for (const std::string& session : *sessions) context_.feed.Changed({request.map(), session});
  }
  return absl::OkStatus();
}

}  // namespace mapkeep
