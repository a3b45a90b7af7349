#include <string>

#include "client/mapkeep/client.h"
#include "client/mapkeep/connection.h"

namespace mapkeep {
namespace {

using Admin = v1::AdminService::Stub;

constexpr absl::Duration kLong = absl::Hours(24);

}  // namespace

absl::StatusOr<VerificationInfo> Client::VerifyMap(std::string_view map) const {
  v1::VerifyMapRequest request;
  request.set_map(std::string(map));
  v1::VerifyMapResponse response;
  const absl::Status status = connection_->Call(connection_->admin(), &Admin::VerifyMap, request, &response, kLong);
  if (!status.ok()) return status;
  return VerificationInfo{response.epochs(),        response.nodes(),
                          response.blocks(),        response.voxels(),
                          response.problem_count(), {response.problems().begin(), response.problems().end()}};
}

absl::StatusOr<GarbageInfo> Client::CollectGarbage(bool dry_run) const {
  v1::CollectGarbageRequest request;
  request.set_dry_run(dry_run);
  v1::CollectGarbageResponse response;
  const absl::Status status =
      connection_->Call(connection_->admin(), &Admin::CollectGarbage, request, &response, kLong);
  if (!status.ok()) return status;
  return GarbageInfo{response.epochs(), response.values(), response.attempts(), response.maps(), response.sessions()};
}

absl::StatusOr<std::vector<std::string>> Client::Backup(const std::string& directory, std::string_view map,
                                                        std::optional<uint64_t> epoch) const {
  v1::BackupRequest request;
  request.set_directory(directory);
  request.set_map(std::string(map));
  if (epoch) request.set_epoch(*epoch);
  v1::BackupResponse response;
  const absl::Status status = connection_->Call(connection_->admin(), &Admin::Backup, request, &response, kLong);
  if (!status.ok()) return status;
  return std::vector<std::string>(response.maps().begin(), response.maps().end());
}

absl::StatusOr<std::vector<std::string>> Client::Restore(const std::string& directory, std::string_view map,
                                                         std::string_view as) const {
  v1::RestoreRequest request;
  request.set_directory(directory);
  request.set_map(std::string(map));
  request.set_as(std::string(as));
  v1::RestoreResponse response;
  const absl::Status status = connection_->Call(connection_->admin(), &Admin::Restore, request, &response, kLong);
  if (!status.ok()) return status;
  return std::vector<std::string>(response.maps().begin(), response.maps().end());
}

absl::StatusOr<ReplayInfo> Client::ReplayMap(std::string_view map) const {
  v1::ReplayMapRequest request;
  request.set_map(std::string(map));
  v1::ReplayMapResponse response;
  const absl::Status status = connection_->Call(connection_->admin(), &Admin::ReplayMap, request, &response, kLong);
  if (!status.ok()) return status;
  return ReplayInfo{response.commits(), response.blocks(), response.different(), response.first_difference()};
}

}  // namespace mapkeep
