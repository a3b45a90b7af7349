#include "client/mapkeep/upload.h"

#include <absl/status/status.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "client/mapkeep/retry_delay.h"
#include "client/mapkeep/scan_checksums.h"
#include "client/mapkeep/wire.h"

namespace mapkeep {
namespace {

constexpr size_t kChunkBytes = 1 << 20;

using ScanStream = grpc::ClientReaderWriter<v1::UploadScansRequest, v1::UploadScansResponse>;

/// One upload on its way: what is kept from attempt to attempt.
class Uploader {
 public:
  using ProgressCallback = std::function<bool(const UploadProgress&)>;

  Uploader(const Connection& connection, const SessionUpload& upload, const ProgressCallback& progress)
      : connection_(connection),
        upload_(upload),
        progress_(progress),
        patience_(connection.options().patience_seconds) {}

  absl::StatusOr<SessionInfo> Run() {
    for (bool reached = false;;) {
      absl::StatusOr<v1::Session> session = Attempt(&reached);
      if (session.ok()) return FromWire(*session);
      // The first call has waited for the server already, so what is not there at the start is reported at once.
      const auto delay = KeptRetryDelay(session.status());  // a quota is full: the server has answered
      if (!delay && (!reached || !IsPassing(session.status()))) return session.status();
      broken_ = true;
      {
        const std::lock_guard lock(mutex_);
        broken_now_ = true;
      }
      if (!Report(durable_)) return absl::CancelledError("stopped");
      if (!patience_.Wait(delay.value_or(absl::ZeroDuration()))) return session.status();
    }
  }

 private:
  /// Whether another attempt may fare better. ABORTED after a break: the server has not yet noticed that our last
  /// stream is dead. OUT_OF_RANGE: it expects another scan, and will say which.
  bool IsPassing(const absl::Status& status) const {
    return absl::IsUnavailable(status) || absl::IsOutOfRange(status) || absl::IsDeadlineExceeded(status) ||
           (broken_ && absl::IsAborted(status));
  }

  /// From Begin to Commit; `reached` is set once the server has answered.
  absl::StatusOr<v1::Session> Attempt(bool* reached) {
    v1::BeginSessionRequest begin;
    begin.set_map(upload_.map);
    begin.set_id(upload_.id);
    begin.set_robot(upload_.robot);
    begin.set_keep_scans(upload_.keep_scans);
    begin.mutable_scan_crc32c()->Assign(upload_.checksums.begin(), upload_.checksums.end());
    if (upload_.start) *begin.mutable_initial_pose() = ToWire(*upload_.start);
    if (upload_.gnss) *begin.mutable_gnss() = ToWire(*upload_.gnss);
    v1::BeginSessionResponse begun;
    absl::Status status =
        connection_.Call(connection_.sessions(), &v1::SessionService::Stub::BeginSession, begin, &begun);
    if (!status.ok()) return status;
    *reached = true;
    if (begun.session().state() != v1::SESSION_STATE_UPLOADING) return begun.session();
    {
      const std::lock_guard lock(mutex_);
      broken_now_ = false;
      bytes_until_[begun.session().durable_scans()] = begun.session().payload_bytes();
    }
    if (!Report(begun.session().durable_scans())) return absl::CancelledError("stopped");
    if (durable_ < upload_.scans.count) {
      status = SendScans(begun.session().durable_scans());
      if (!status.ok()) return status;
    }
    v1::CommitSessionRequest commit;
    commit.set_map(upload_.map);
    commit.set_id(upload_.id);
    v1::CommitSessionResponse committed;
    status = connection_.Call(connection_.sessions(), &v1::SessionService::Stub::CommitSession, commit, &committed);
    if (!status.ok()) return status;
    return committed.session();
  }

  /// Streams scans [first, count) while a second thread takes the answers.
  absl::Status SendScans(uint32_t first) {
    grpc::ClientContext context;
    const std::unique_ptr<ScanStream> stream = connection_.sessions().UploadScans(&context);
    std::atomic<bool> stopped = false;
    std::thread answers([&] {
      for (v1::UploadScansResponse answer; stream->Read(&answer);) {
        if (!stopped && !Report(answer.durable_scans())) {
          stopped = true;
          context.TryCancel();
        }
      }
    });
    const absl::Status written = WriteScans(*stream, first);
    if (!written.ok()) context.TryCancel();
    answers.join();
    const absl::Status status = connection_.StatusOf(stream->Finish());
    if (stopped) return absl::CancelledError("stopped");
    if (!written.ok()) return written;
    if (status.ok() && durable_ < upload_.scans.count) {
      return absl::UnavailableError(
          absl::StrFormat("the server ended the upload at scan %d of %d", durable_, upload_.scans.count));
    }
    return status;
  }

  /// An error is one of the source; when the stream breaks, its own status says why.
  absl::Status WriteScans(ScanStream& stream, uint32_t first) {
    v1::UploadScansRequest open;
    open.mutable_open()->set_map(upload_.map);
    open.mutable_open()->set_id(upload_.id);
    bool alive = stream.Write(open);
    for (uint32_t index = first; alive && index < upload_.scans.count; ++index) {
      const absl::StatusOr<Scan> scan = upload_.scans.read(index);
      if (!scan.ok()) return scan.status();
      const absl::StatusOr<std::string> bytes = EncodePayload(*scan, upload_.encoding);
      if (!bytes.ok()) return bytes.status();
      const uint32_t checksum = ScanChecksum(*bytes, upload_.poses[index], scan->time);
      if (checksum != upload_.checksums[index]) {
        return absl::InvalidArgumentError(absl::StrFormat("scan %d changed while the session was being read", index));
      }
      v1::UploadScansRequest header;
      header.mutable_scan()->set_index(index);
      header.mutable_scan()->set_point_count(static_cast<uint32_t>(scan->points.size()));
      header.mutable_scan()->set_time(scan->time);
      header.mutable_scan()->set_crc32c(checksum);
      header.mutable_scan()->set_format(ToWire(FormatOf(upload_.encoding)));
      header.mutable_scan()->set_payload_bytes(static_cast<uint32_t>(bytes->size()));
      ToWire(upload_.poses[index], header.mutable_scan()->mutable_pose());
      {
        const std::lock_guard lock(mutex_);
        bytes_until_[index + 1] = bytes_until_[index] + bytes->size();
      }
      alive = stream.Write(header) && WriteChunks(stream, *bytes);
    }
    stream.WritesDone();
    return absl::OkStatus();
  }

  static bool WriteChunks(ScanStream& stream, std::string_view bytes) {
    v1::UploadScansRequest chunk;
    bool alive = true;
    while (alive && !bytes.empty()) {
      const std::string_view part = bytes.substr(0, kChunkBytes);
      chunk.set_chunk(part.data(), part.size());
      alive = stream.Write(chunk);
      bytes.remove_prefix(part.size());
    }
    return alive;
  }

  /// Notes what is durable; false if the caller wants to stop.
  bool Report(uint32_t durable) {
    if (durable > durable_) patience_.Renew();
    durable_ = std::max(durable, durable_);
    if (!progress_) return true;
    UploadProgress now{.durable_scans = durable_, .scan_count = static_cast<uint32_t>(upload_.scans.count)};
    {
      const std::lock_guard lock(mutex_);
      now.durable_bytes = bytes_until_[durable_];
      now.is_broken = broken_now_;
    }
    return progress_(now);
  }

  const Connection& connection_;
  const SessionUpload& upload_;
  const ProgressCallback& progress_;
  Patience patience_;
  uint32_t durable_ = 0;  ///< most that the server ever said
  bool broken_ = false;   ///< an earlier attempt ended early
  std::mutex mutex_;
  std::vector<uint64_t> bytes_until_ =
      std::vector<uint64_t>(upload_.scans.count + 1);  ///< payloads of scans [0, i); guarded, as what follows
  bool broken_now_ = false;
};

}  // namespace

absl::StatusOr<SessionInfo> UploadSession(const Connection& connection, const SessionUpload& upload,
                                          const std::function<bool(const UploadProgress&)>& progress) {
  if (upload.scans.count == 0 || upload.poses.size() != upload.scans.count ||
      upload.checksums.size() != upload.scans.count) {
    return absl::InvalidArgumentError(absl::StrFormat("%d poses and %d checksums for %d scans", upload.poses.size(),
                                                      upload.checksums.size(), upload.scans.count));
  }
  return Uploader(connection, upload, progress).Run();
}

}  // namespace mapkeep
