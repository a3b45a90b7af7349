#include "client/mapkeep/localize.h"

#include <absl/status/statusor.h>

#include <algorithm>
#include <string>
#include <string_view>

#include "client/mapkeep/client.h"
#include "client/mapkeep/connection.h"
#include "client/mapkeep/scan_checksums.h"
#include "client/mapkeep/wire.h"

namespace mapkeep {
namespace {

constexpr size_t kChunkBytes = 1 << 20;

// False once the server listens no more; its status says why.
absl::StatusOr<bool> WriteScan(grpc::ClientWriter<v1::LocalizeRequest>& stream, const LocalizeQuestion& question,
                               uint32_t index) {
  const absl::StatusOr<Scan> scan = question.scans.read(index);
  if (!scan.ok()) return scan.status();
  const absl::StatusOr<std::string> bytes = EncodePayload(*scan, question.encoding);
  if (!bytes.ok()) return bytes.status();
  v1::LocalizeRequest header;
  header.mutable_scan()->set_index(index);
  header.mutable_scan()->set_point_count(static_cast<uint32_t>(scan->points.size()));
  header.mutable_scan()->set_time(scan->time);
  header.mutable_scan()->set_crc32c(ScanChecksum(*bytes, question.poses[index], scan->time));
  header.mutable_scan()->set_format(ToWire(FormatOf(question.encoding)));
  header.mutable_scan()->set_payload_bytes(static_cast<uint32_t>(bytes->size()));
  ToWire(question.poses[index], header.mutable_scan()->mutable_pose());
  bool alive = stream.Write(header);
  for (std::string_view left = *bytes; alive && !left.empty(); left.remove_prefix(std::min(left.size(), kChunkBytes))) {
    v1::LocalizeRequest chunk;
    const std::string_view part = left.substr(0, kChunkBytes);
    chunk.set_chunk(part.data(), part.size());
    alive = stream.Write(chunk);
  }
  return alive;
}

}  // namespace

absl::StatusOr<LocalizeAnswer> Client::Localize(const LocalizeQuestion& question) const {
  if (absl::Status reached = connection_->WaitForServer(); !reached.ok()) return reached;
  grpc::ClientContext context;
  v1::LocalizeResponse response;
  const auto stream = connection_->localization().Localize(&context, &response);
  v1::LocalizeRequest open;
  open.mutable_open()->set_map(question.map);
  if (question.start) *open.mutable_open()->mutable_initial_pose() = ToWire(*question.start);
  bool alive = stream->Write(open);
  for (uint32_t index = 0; alive && index < question.scans.count; ++index) {
    const absl::StatusOr<bool> written = WriteScan(*stream, question, index);
    if (!written.ok()) {
      context.TryCancel();
      static_cast<void>(stream->Finish());
      return written.status();
    }
    alive = *written;
  }
  stream->WritesDone();
  if (absl::Status status = connection_->StatusOf(stream->Finish()); !status.ok()) return status;
  LocalizeAnswer answer{.found = response.found(), .reason = response.reason(), .epoch = response.epoch()};
  if (!answer.found) return answer;
  const absl::StatusOr<Pose> pose = FromWire(response.pose());
  if (!pose.ok()) return pose.status();
  if (response.covariance_size() != 36) return absl::DataLossError("the covariance has not 36 values");
  answer.pose = *pose;
  answer.fitness = response.fitness();
  answer.inliers = response.inliers();
  for (int i = 0; i < 36; ++i) answer.covariance(i / 6, i % 6) = response.covariance(i);
  return answer;
}

}  // namespace mapkeep
