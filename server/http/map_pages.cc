#include "server/http/map_pages.h"

#include <absl/strings/str_cat.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "mapkeep/v1/map_service.pb.h"
#include "mapkeep/v1/session_service.pb.h"
#include "server/names.h"
#include "server/rpc/convert.h"
#include "server/rpc/paging.h"
#include "server/rpc/voxel_answer.h"

namespace mapkeep {
namespace {

constexpr uint64_t kMostPoses = 10000;

// Zeros are written, too, so that a reader need not know what a missing field means.
absl::StatusOr<std::string> JsonOf(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(message, &json, options);
  if (!status.ok()) return absl::InternalError(absl::StrCat("cannot write JSON: ", status.ToString()));
  return json;
}

PageResponse JsonPage(std::string json) {
  json += '\n';
  return {.body = std::make_shared<const std::string>(std::move(json))};
}

absl::StatusOr<PageResponse> MessagePage(const google::protobuf::Message& message) {
  auto json = JsonOf(message);
  if (!json.ok()) return json.status();
  return JsonPage(*std::move(json));
}

absl::StatusOr<size_t> PageSizeOf(const RequestTarget& target, const char* name) {
  const auto asked = target.QueryNumber(name);
  if (!asked.ok()) return asked.status();
  return PageSize(static_cast<uint32_t>(std::min<uint64_t>(asked->value_or(0), UINT32_MAX)));
}

absl::StatusOr<SessionRecord> FindSession(const PageContext& context, const std::string& map, const std::string& id) {
  if (absl::Status status = CheckName("session id", id); !status.ok()) return status;
  absl::StatusOr<SessionRecord> session = context.sessions.Find(map, id);
  if (absl::IsNotFound(session.status())) {
    if (absl::Status status = context.maps.Find(map).status(); !status.ok()) return status;
  }
  return session;
}

}  // namespace

absl::StatusOr<PageResponse> ListMapsPage(const PageContext& context, const Caller& caller,
                                          const RequestTarget& target) {
  const auto size = PageSizeOf(target, "pageSize");
  if (!size.ok()) return size.status();
  const auto after = PositionOf(target.Query("pageToken"));
  if (!after.ok()) return after.status();
  const auto records = context.maps.List(*after, *size + 1);
  if (!records.ok()) return records.status();
  v1::ListMapsResponse response;
  for (size_t i = 0; i < std::min(*size, records->size()); ++i) {
    const std::string& name = (*records)[i].name;
    if (!caller.May(Access::kRead, name)) continue;
    const auto snapshot = context.maps.Open(name);
    if (absl::IsNotFound(snapshot.status())) continue;  // deleted since
    if (!snapshot.ok()) return snapshot.status();
    *response.add_maps() = ToProto(**snapshot);
  }
  if (records->size() > *size) response.set_next_page_token(PageToken((*records)[*size - 1].name));
  return MessagePage(response);
}

absl::StatusOr<PageResponse> MapPage(const PageContext& context, const std::string& map) {
  const auto snapshot = context.maps.Open(map);
  if (!snapshot.ok()) return snapshot.status();
  return MessagePage(ToProto(**snapshot));
}

absl::StatusOr<std::string> EpochJson(const MapVersion& version) {
  const auto json = JsonOf(ToProto(version));
  if (!json.ok()) return json.status();
  nlohmann::ordered_json with_kind = nlohmann::ordered_json::parse(*json);
  const CommitRecord& commit = version.commit;
  with_kind["kind"] = commit.rollback ? "rollback" : commit.session.empty() ? "empty" : "session";
  return with_kind.dump();
}

absl::StatusOr<PageResponse> EpochsPage(const PageContext& context, const std::string& map,
                                        const RequestTarget& target) {
  const auto limit = PageSizeOf(target, "limit");
  if (!limit.ok()) return limit.status();
  const auto versions = context.maps.Versions(map, std::nullopt, *limit);
  if (!versions.ok()) return versions.status();
  std::string json = R"({"epochs":[)";
  for (const MapVersion& version : *versions) {
    const auto one = EpochJson(version);
    if (!one.ok()) return one.status();
    absl::StrAppend(&json, &version == &versions->front() ? "" : ",", *one);
  }
  return JsonPage(json + "]}");
}

absl::StatusOr<std::string> SessionJson(const PageContext& context, const SessionRecord& session) {
  return JsonOf(ToProto(session, context.feed.Progress({session.map, session.id})));
}

absl::StatusOr<PageResponse> SessionsPage(const PageContext& context, const std::string& map,
                                          const RequestTarget& target) {
  if (absl::Status status = context.maps.Find(map).status(); !status.ok()) return status;
  const auto size = PageSizeOf(target, "pageSize");
  if (!size.ok()) return size.status();
  const auto after = PositionOf(target.Query("pageToken"));
  if (!after.ok()) return after.status();
  const auto page = context.sessions.List(map, *after, *size);
  if (!page.ok()) return page.status();
  v1::ListSessionsResponse response;
  for (const SessionRecord& session : page->sessions) {
    *response.add_sessions() = ToProto(session, context.feed.Progress({map, session.id}));
  }
  if (!page->next.empty()) response.set_next_page_token(PageToken(page->next));
  return MessagePage(response);
}

absl::StatusOr<PageResponse> SessionPage(const PageContext& context, const std::string& map, const std::string& id) {
  const auto session = FindSession(context, map, id);
  if (!session.ok()) return session.status();
  auto json = SessionJson(context, *session);
  if (!json.ok()) return json.status();
  return JsonPage(*std::move(json));
}

absl::StatusOr<PageResponse> PosesPage(const PageContext& context, const std::string& map, const std::string& id,
                                       const RequestTarget& target) {
  const auto session = FindSession(context, map, id);
  if (!session.ok()) return session.status();
  if (session->state != SessionState::kCommitted) {
    return absl::FailedPreconditionError(absl::StrCat("session ", id, " is not committed"));
  }
  const auto first = target.QueryNumber("first"), size = target.QueryNumber("pageSize");
  if (!first.ok()) return first.status();
  if (!size.ok()) return size.status();
  const auto poses = context.sessions.ReadPoses(map, id);
  if (!poses.ok()) return poses.status();
  v1::ListScanPosesResponse response;
  const uint64_t asked = size->value_or(0), begin = std::min<uint64_t>(first->value_or(0), poses->size());
  const uint64_t count = asked == 0 ? kMostPoses : std::min(asked, kMostPoses);
  const uint64_t end = std::min<uint64_t>(poses->size(), begin + count);
  for (uint64_t i = begin; i < end; ++i) *response.add_poses() = ToProto((*poses)[i]);
  response.set_scan_count(static_cast<uint32_t>(poses->size()));
  return MessagePage(response);
}

absl::StatusOr<PageResponse> VoxelPage(const PageContext& context, const std::string& map,
                                       const RequestTarget& target) {
  const auto x = target.QueryCoordinate("x"), y = target.QueryCoordinate("y"), z = target.QueryCoordinate("z");
  for (const auto* coordinate : {&x, &y, &z}) {
    if (!coordinate->ok()) return coordinate->status();
  }
  const auto epoch = target.QueryNumber("epoch");
  if (!epoch.ok()) return epoch.status();
  const auto snapshot = context.maps.Open(map, *epoch);
  if (absl::IsFailedPrecondition(snapshot.status())) {
    return ErrorPage(410, "FAILED_PRECONDITION", std::string(snapshot.status().message()));
  }
  if (!snapshot.ok()) return snapshot.status();
  const auto answer = VoxelAt(**snapshot, {*x, *y, *z}, context.config.stages.filter.eta);
  if (!answer.ok()) return answer.status();
  return MessagePage(*answer);
}

}  // namespace mapkeep
