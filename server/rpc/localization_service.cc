#include "server/rpc/localization_service.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "core/registration/localisation.h"
#include "core/registration/session_search.h"
#include "server/log.h"
#include "server/pipeline/map_target.h"
#include "server/rpc/convert.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/scan_assembly.h"

namespace mapkeep {
namespace {

constexpr size_t kMostScans = 64;
constexpr size_t kMostBytes = size_t{256} << 20;

// The scans of a call, their poses relative to the map's origin.
struct Scans {
  std::vector<Scan> scans;
  std::vector<Pose> poses;
};

absl::StatusOr<Scans> Decoded(std::vector<RawScan> raw, const MapRange& range) {
  Scans decoded;
  for (RawScan& one : raw) {
    const uint32_t crc32c = one.header.crc32c();
    const auto checked = CheckScan(std::move(one), crc32c, range);
    if (!checked.ok()) return checked.status();
    auto scan = DecodeScan(checked->value);
    if (!scan.ok()) return scan.status();
    decoded.scans.push_back(std::move(scan->scan));
    decoded.poses.push_back(scan->pose);
    decoded.poses.back().translation() -= range.origin;
  }
  return decoded;
}

absl::Status Find(const ServiceContext& context, const v1::OpenLocalization& open, std::vector<RawScan> raw,
                  v1::LocalizeResponse& response) {
  const auto base = context.maps.Open(open.map());
  if (!base.ok()) return base.status();
  response.set_epoch((*base)->epoch());
  if ((*base)->totals().blocks == 0) {
    response.set_reason("the map is empty");
    return absl::OkStatus();
  }
  MapRange range{.voxel_size = (*base)->map().voxel_size};
  if ((*base)->map().origin) range.origin = *(*base)->map().origin;
  const size_t count = raw.size();
  auto scans = Decoded(std::move(raw), range);
  if (!scans.ok()) return scans.status();
  std::optional<Pose> prior;
  if (open.has_initial_pose()) {
    const v1::Point& at = open.initial_pose().position();
    prior = PriorFrom({at.x(), at.y(), at.z()}, open.initial_pose().yaw(), scans->poses.front());
    if (!prior->matrix().allFinite()) return absl::InvalidArgumentError("initial_pose: expected finite numbers");
  }
  const AlignParameters& parameters = context.config.stages.align;
  tbb::task_arena arena;
  const auto place = arena.execute([&] {
    return Localise(SourceOf(std::move(scans->scans)), scans->poses,
                    TargetOf(**base, context.plans, {}, parameters.matcher), prior, parameters);
  });
  if (!place.ok()) return place.status();
  LogInfo("localised", {{"map", open.map()}, {"scans", count}, {"found", place->found ? 1 : 0}});
  response.set_found(place->found);
  response.set_reason(place->reason);
  if (!place->found) return absl::OkStatus();
  *response.mutable_pose() = ToProto(place->pose);
  response.set_fitness(place->fitness);
  response.set_inliers(place->inliers);
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) response.add_covariance(place->covariance(row, column));
  }
  return absl::OkStatus();
}

// Reads to the end of the stream, then works on the pool.
class Localization final : public grpc::ServerReadReactor<v1::LocalizeRequest> {
 public:
  Localization(const ServiceContext& context, Call call, v1::LocalizeResponse* response)
      : context_(context), call_(std::move(call)), response_(response) {
    StartRead(&request_);
  }

  void OnReadDone(bool ok) override {
    if (!ok) return End();
    if (absl::Status status = Receive(); !status.ok()) return Finish(ToGrpc(status));
    StartRead(&request_);
  }

  void OnDone() override { delete this; }

 private:
  absl::Status Receive() {
    switch (request_.part_case()) {
      case v1::LocalizeRequest::kOpen:
        if (open_) return absl::InvalidArgumentError("a second `open`");
        open_ = request_.open();
        return Gate::Enter(call_, request_);
      case v1::LocalizeRequest::kScan:
        if (!open_) return absl::InvalidArgumentError("the first message must be `open`");
        if (request_.scan().index() != scans_.size()) {
          return absl::InvalidArgumentError(
              absl::StrFormat("scan %d: expected scan %d", request_.scan().index(), scans_.size()));
        }
        if (scans_.size() == kMostScans) {
          return absl::ResourceExhaustedError(absl::StrFormat("more than %d scans", kMostScans));
        }
        return assembly_.Begin(std::move(*request_.mutable_scan()));
      case v1::LocalizeRequest::kChunk: {
        const std::string_view chunk = request_.chunk();
        if (absl::Status status = assembly_.Append({&chunk, 1}); !status.ok()) return status;
        if (bytes_ + assembly_.bytes() > kMostBytes) return TooMuch();
        if (!assembly_.complete()) return absl::OkStatus();
        scans_.push_back(assembly_.Take());
        bytes_ += std::max(scans_.back().payload().size(), scans_.back().DecodedBytes());
        return bytes_ > kMostBytes ? TooMuch() : absl::OkStatus();
      }
      default:
        return absl::InvalidArgumentError("a message without `open`, `scan` or `chunk`");
    }
  }

  static absl::Status TooMuch() {
    return absl::ResourceExhaustedError(absl::StrFormat("more than %d bytes of points", kMostBytes));
  }

  void End() {
    if (assembly_.under_way()) {
      return Finish(
          ToGrpc(absl::InvalidArgumentError(absl::StrCat("the stream ended while ", assembly_.Description()))));
    }
    if (!open_ || scans_.empty()) return Finish(ToGrpc(absl::InvalidArgumentError("there is no scan to look for")));
    context_.pool.Submit([this] {
      const LogScope scope(call_.tags());
      Finish(ToGrpc(Find(context_, *open_, std::move(scans_), *response_)));
    });
  }

  const ServiceContext context_;
  Call call_;
  v1::LocalizeResponse* response_;
  v1::LocalizeRequest request_;
  std::optional<v1::OpenLocalization> open_;
  ScanAssembly assembly_;
  std::vector<RawScan> scans_;
  size_t bytes_ = 0;
};

}  // namespace

grpc::ServerReadReactor<v1::LocalizeRequest>* LocalizationService::Localize(grpc::CallbackServerContext* call,
                                                                            v1::LocalizeResponse* response) {
  return Admitted<grpc::ServerReadReactor<v1::LocalizeRequest>>(
      context_.gate, *call, v1::LocalizeRequest(),
      [&](Call of) { return new Localization(context_, std::move(of), response); });
}

}  // namespace mapkeep
