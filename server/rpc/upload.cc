#include "server/rpc/upload.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mapkeep/v1/common.pb.h"
#include "server/pipeline/outline.h"
#include "server/rpc/convert.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/scan_assembly.h"
#include "server/rpc/sessions.h"

namespace mapkeep {
namespace {

using Reactor = grpc::ServerBidiReactor<v1::UploadScansRequest, v1::UploadScansResponse>;

// The call moves through: reading `open` -> opening (on the pool) -> reading scans, while batches of them are staged
// (on the pool) and acknowledged -> no more reading, for the client's end or an error -> the last batch -> Finish.
class Upload final : public Reactor {
 public:
  Upload(const ServiceContext& context, grpc::CallbackServerContext& stream, Call call, UploadSlots& slots)
      : context_(context),
        stream_(stream),
        call_(std::move(call)),
        slots_(slots),
        pending_limit_(static_cast<size_t>(context.config.limits.upload_pending_mib) << 20),
        total_limit_(static_cast<int64_t>(context.config.limits.rpc_memory_mib) << 20) {}

  // Lives until the call is done and nothing on the pool still means it.
  static Upload* Begin(const ServiceContext& context, grpc::CallbackServerContext& stream, Call call,
                       UploadSlots& slots) {
    auto upload = std::make_shared<Upload>(context, stream, std::move(call), slots);
    upload->self_ = upload;
    upload->StartRead(&upload->request_);
    return upload.get();
  }

  void OnReadDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    reading_ = false;
    if (!ok) {
      reads_ended_ = true;
      if (assembly_.under_way()) {
        Fail(absl::InvalidArgumentError(absl::StrCat("the stream ended while ", assembly_.Description())));
      } else if (!taken_) {
        Fail(absl::InvalidArgumentError("the stream ended before its first message, `open`"));
      }
    } else if (!ending_) {
      if (absl::Status status = Receive(); !status.ok()) Fail(status);
    }
    Proceed();
  }

  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    if (!ok) vanished_ = true;
    Proceed();
  }

  void OnCancel() override {
    const std::lock_guard lock(mutex_);
    vanished_ = true;
    Fail(absl::CancelledError("the client went away"));
    Proceed();
  }

  void OnDone() override { const std::shared_ptr<Upload> last = std::move(self_); }

 private:
  // Takes in one message.
  absl::Status Receive() {
    switch (request_.part_case()) {
      case v1::UploadScansRequest::kOpen:
        return taken_ ? absl::InvalidArgumentError("a second `open`") : Open();
      case v1::UploadScansRequest::kScan:
      case v1::UploadScansRequest::kChunk:
        if (!taken_) return absl::InvalidArgumentError("the first message must be `open`");
        return request_.has_scan() ? BeginScan() : Append();
      default:
        return absl::InvalidArgumentError("a message without `open`, `scan` or `chunk`");
    }
  }

  absl::Status Open() {
    if (absl::Status status = Gate::Enter(call_, request_); !status.ok()) return status;
    session_ = {request_.open().map(), request_.open().id()};
    if (!slots_.Take(session_, [this] { Stop(); })) {
      return absl::AbortedError(
          absl::StrFormat("session %s of map %s has another upload under way", session_.second, session_.first));
    }
    taken_ = true;
    busy_ = true;
    context_.pool.Submit([self = self_] { self->OpenSession(); });
    return absl::OkStatus();
  }

  absl::Status BeginScan() {
    const uint32_t index = request_.scan().index();
    if (index != next_index_ || index >= record_.scan_crc32c.size()) {
      wrong_index_ = true;
      return absl::OutOfRangeError(index == next_index_
                                       ? absl::StrFormat("scan %d: the session has %d scans", index, next_index_)
                                       : absl::StrFormat("scan %d: expected scan %d", index, next_index_));
    }
    return assembly_.Begin(std::move(*request_.mutable_scan()));
  }

  absl::Status Append() {
    if (absl::Status status = assembly_.Append(request_.chunk()); !status.ok()) return status;
    if (assembly_.complete()) {
      pending_.push_back(assembly_.Take());
      // What they will take counts, too: a few bytes may decode to many points.
      const size_t bytes = std::max(pending_.back().bytes.size(), pending_.back().DecodedBytes());
      pending_bytes_ += bytes;
      CountPending(static_cast<int64_t>(bytes));
      ++next_index_;
    }
    return absl::OkStatus();
  }

  // On the pool: finds the session and what its scans must fit into.
  void OpenSession() {
    absl::StatusOr<SessionRecord> session =
        FindSession(context_, call_, Access::kUpload, session_.first, session_.second);
    absl::Status status = session.status();
    if (status.ok() && session->state != SessionState::kUploading) {
      status = absl::FailedPreconditionError(absl::StrCat("session ", session->id, " has all its scans"));
    }
    if (status.ok()) status = FindRange(*session);
    const std::lock_guard lock(mutex_);
    busy_ = false;
    if (status.ok()) {
      record_ = *std::move(session);
      next_index_ = record_.durable_scans;
      acknowledge_ = true;
    } else {
      Fail(status);
    }
    Proceed();
  }

  absl::Status FindRange(const SessionRecord& session) {
    const auto snapshot = context_.maps.Open(session.map);
    if (!snapshot.ok()) return snapshot.status();
    const MapRecord& map = (*snapshot)->map();
    range_.voxel_size = map.voxel_size;
    if (map.origin) range_.origin = *map.origin;
    takes_origin_ = !map.origin && (*snapshot)->epoch() == 0;
    if (!takes_origin_ || session.durable_scans == 0) return absl::OkStatus();
    const auto first = context_.sessions.ReadScan(session.map, session.id, 0);
    if (!first.ok()) return first.status();
    range_.origin = OriginFor(first->pose).value_or(Eigen::Vector3d(Eigen::Vector3d::Zero()));
    return absl::OkStatus();
  }

  // On the pool: checks and stages a batch.
  void Stage(const std::vector<RawScan>& batch, uint32_t first) {
    std::vector<StagedScan> staged;
    absl::Status bad;
    for (const RawScan& raw : batch) {
      const uint32_t index = raw.header.index();
      if (index == 0 && takes_origin_) {
        if (const auto pose = FromProto(raw.header.pose()); pose.ok()) {
          range_.origin = OriginFor(*pose).value_or(Eigen::Vector3d(Eigen::Vector3d::Zero()));
        }
      }
      auto scan = DecodeScan(raw, record_.scan_crc32c[index], range_);
      if (!scan.ok()) {
        bad = scan.status();
        break;
      }
      staged.push_back(*std::move(scan));
    }
    size_t sent = 0, kept = 0;  // bytes; quotas are of what is kept
    for (size_t i = 0; i < staged.size(); ++i) {
      sent += batch[i].bytes.size();
      kept += batch[i].DecodedBytes();
    }
    absl::Status status = context_.quotas.Append(session_.first, session_.second, kept);
    if (status.ok() && !staged.empty()) {
      status = context_.sessions.AppendScans(session_.first, session_.second, first, staged);
      if (!status.ok()) Recount();
    }
    if (status.ok() && !staged.empty()) {
      context_.metrics.Staged(staged.size(), sent);
      context_.feed.Changed(session_);
    }

    const std::lock_guard lock(mutex_);
    busy_ = false;
    CountPending(-static_cast<int64_t>(std::exchange(staging_bytes_, 0)));
    if (status.ok() && !staged.empty()) {
      record_.durable_scans = first + static_cast<uint32_t>(staged.size());
      acknowledge_ = true;
    }
    const bool elsewhere = absl::IsOutOfRange(status);  // another daemon has staged scans of this session
    if (status.ok()) status = bad;
    if (!status.ok()) {
      // What came behind cannot be staged, so this is the error, whatever else was wrong there.
      pending_.clear();
      CountPending(-static_cast<int64_t>(std::exchange(pending_bytes_, 0)));
      wrong_index_ = elsewhere;
      failure_.reset();
      Fail(status);
    }
    Proceed();
  }

  void CountPending(int64_t bytes) {
    context_.metrics.Pending(static_cast<double>(bytes));
    slots_.AddPending(bytes);
  }

  // What was counted as staged is not.
  void Recount() {
    const auto session = context_.sessions.Find(session_.first, session_.second);
    if (session.ok()) context_.quotas.Note(*session);
  }

  // The daemon ends. Called under the slots' mutex, so it goes to the pool.
  void Stop() {
    context_.pool.Submit([self = self_] {
      const std::lock_guard lock(self->mutex_);
      self->Fail(absl::UnavailableError("the daemon is stopping; upload again and go on"));
      self->Proceed();
    });
  }

  // Nothing more is read; what is complete is still staged. The first failure is the one that counts.
  void Fail(const absl::Status& status) {
    ending_ = true;
    if (!failure_) failure_ = status;
  }

  // With the mutex held: starts whatever can be started.
  void Proceed() {
    if (finished_) return;
    if (!busy_ && !pending_.empty()) {
      busy_ = true;
      staging_bytes_ = std::exchange(pending_bytes_, 0);
      context_.staging.Submit([self = self_, batch = std::exchange(pending_, {}), first = record_.durable_scans] {
        self->Stage(batch, first);
      });
    }
    if (vanished_) acknowledge_ = false;
    if (!writing_ && acknowledge_) {
      acknowledge_ = false;
      writing_ = true;
      response_.set_durable_scans(record_.durable_scans);
      StartWrite(&response_);
    }
    if ((ending_ || reads_ended_) && !busy_ && !writing_ && pending_.empty()) {
      finished_ = true;
      // Before the client hears of the end: it may come again at once.
      if (taken_) slots_.Free(session_);
      FinishCall(stream_, *this, failure_.value_or(absl::OkStatus()), Details());
      return;
    }
    // One scan may pass the bounds: without its end there is nothing to stage. Beyond that one scan an upload takes
    // part in what all together may hold; its own batch, once durable, makes it look again.
    const size_t held = pending_bytes_ + staging_bytes_;
    const bool has_room = held == 0 || (held < pending_limit_ && slots_.pending() < total_limit_);
    if (!reading_ && !reads_ended_ && !ending_ && has_room && !(busy_ && record_.scan_crc32c.empty())) {
      reading_ = true;
      StartRead(&request_);
    }
  }

  std::string Details() const {
    if (!wrong_index_) return "";
    v1::ExpectedScan expected;
    expected.set_index(record_.durable_scans);
    return expected.SerializeAsString();
  }

  const ServiceContext context_;
  grpc::CallbackServerContext& stream_;
  Call call_;
  UploadSlots& slots_;
  std::shared_ptr<Upload> self_;
  const size_t pending_limit_;
  const int64_t total_limit_;  // of all uploads

  std::mutex mutex_;
  v1::UploadScansRequest request_;
  v1::UploadScansResponse response_;
  UploadSlots::Key session_;
  SessionRecord record_;       // durable_scans moves with the batches
  MapRange range_;             // pool only
  bool takes_origin_ = false;  // the map's origin will be this session's; pool only
  ScanAssembly assembly_;
  uint32_t next_index_ = 0;
  std::vector<RawScan> pending_;  // complete, not given to the pool yet
  size_t pending_bytes_ = 0, staging_bytes_ = 0;
  std::optional<absl::Status> failure_;
  bool wrong_index_ = false;
  bool taken_ = false;                     // the session's slot
  bool reading_ = true, writing_ = false;  // at most one each is in flight
  bool busy_ = false;                      // something of this call is on the pool
  bool acknowledge_ = false;               // durable_scans moved since the last write
  bool reads_ended_ = false, ending_ = false, vanished_ = false, finished_ = false;
};

}  // namespace

Reactor* NewUpload(const ServiceContext& context, grpc::CallbackServerContext& stream, Call call, UploadSlots& slots) {
  return Upload::Begin(context, stream, std::move(call), slots);
}

}  // namespace mapkeep
