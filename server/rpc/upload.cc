#include "server/rpc/upload.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mapkeep/v1/common.pb.h"
#include "mapkeep/v1/session_service.pb.h"
#include "server/pipeline/outline.h"
#include "server/rpc/chunk_message.h"
#include "server/rpc/convert.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/scan_assembly.h"
#include "server/rpc/sessions.h"
#include "server/rpc/tile_buffers.h"
#include "storage/pause.h"

namespace mapkeep {
namespace {

using Reactor = grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>;

// Messages that wait to be decoded lie in gRPC's own buffers, which all calls share: few of one upload, and a quarter
// of the bound on them of all.
constexpr size_t kMostReceived = size_t{8} << 20;
constexpr int64_t kShareReceived = 4;
constexpr size_t kMessageOverhead = 512;  // a byte takes more than a byte there

// The call moves through: reading `open` -> opening (on the pool) -> reading messages, while those that came are put
// together to scans, and batches of scans staged and acknowledged (both on the pool of uploads, one of each at a time)
// -> no more reading, for the client's end or an error -> what is left -> Finish.
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
    upload->StartRead(&upload->message_);
    return upload.get();
  }

  void OnReadDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    reading_ = false;
    if (!ok) {
      reads_ended_ = true;
    } else if (!ending_) {
      CountReceived(static_cast<int64_t>(message_.Length() + kMessageOverhead));
      received_.push_back(std::move(message_));
    }
    message_.Clear();
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
  // The next message that came; nothing: none is to be taken now.
  std::optional<grpc::ByteBuffer> NextMessage() {
    const std::lock_guard lock(mutex_);
    if (ending_ || received_.empty() || !HasRoomForScans()) {
      assembling_ = false;
      Proceed();
      return std::nullopt;
    }
    grpc::ByteBuffer message = std::move(received_.front());
    received_.pop_front();
    CountReceived(-static_cast<int64_t>(message.Length() + kMessageOverhead));
    return message;
  }

  // On the pool: opens the session that the first message names.
  void Open() {
    std::optional<grpc::ByteBuffer> message = NextMessage();
    if (!message) return;
    absl::StatusOr<SessionRecord> session = OpenSession(*message);
    const std::lock_guard lock(mutex_);
    assembling_ = false;
    if (session.ok()) {
      record_ = *std::move(session);
      next_index_ = record_.durable_scans;
      opened_ = true;
      acknowledge_ = true;
    } else {
      Fail(session.status());
    }
    Proceed();
  }

  // On the pool of uploads: takes in what came. What is not complete is not counted: it is one scan at most.
  void Assemble() {
    while (std::optional<grpc::ByteBuffer> message = NextMessage()) {
      const absl::Status status = Receive(*message);
      message.reset();
      LetOthersRun();
      const std::lock_guard lock(mutex_);
      ++messages_;
      if (!status.ok()) {
        if (!ending_) wrong_index_ = absl::IsOutOfRange(status);
        Fail(status);
      } else if (assembly_.complete()) {
        RawScan scan = assembly_.Take();
        ++next_index_;
        if (ending_) continue;
        // What they will take counts, too: a few bytes may decode to many points.
        const size_t bytes = std::max(scan.payload().size(), scan.DecodedBytes());
        pending_.push_back(std::move(scan));
        pending_bytes_ += bytes;
        CountPending(static_cast<int64_t>(bytes));
        Proceed();
      }
    }
  }

  absl::Status Decode(grpc::ByteBuffer& message) {
    if (grpc::SerializationTraits<v1::UploadScansRequest>::Deserialize(&message, &request_).ok()) {
      return absl::OkStatus();
    }
    return absl::InvalidArgumentError(absl::StrFormat("message %d of the stream (from 0) is not a %s", messages_,
                                                      request_.GetDescriptor()->full_name()));
  }

  absl::Status Receive(grpc::ByteBuffer& message) {
    std::vector<grpc::Slice> slices;
    if (message.Dump(&slices).ok()) {
      std::vector<std::string_view> pieces;
      pieces.reserve(slices.size());
      for (const grpc::Slice& slice : slices) {
        pieces.emplace_back(reinterpret_cast<const char*>(slice.begin()), slice.size());
      }
      if (const auto chunk = ChunkIn(pieces)) return assembly_.Append(*chunk);
    }
    if (absl::Status status = Decode(message); !status.ok()) return status;
    switch (request_.part_case()) {
      case v1::UploadScansRequest::kOpen:
        return absl::InvalidArgumentError("a second `open`");
      case v1::UploadScansRequest::kScan:
        return BeginScan();
      case v1::UploadScansRequest::kChunk: {
        const std::string_view chunk = request_.chunk();
        return assembly_.Append({&chunk, 1});
      }
      default:
        return NoPart();
    }
  }

  static absl::Status NoPart() { return absl::InvalidArgumentError("a message without `open`, `scan` or `chunk`"); }

  absl::Status BeginScan() {
    const uint32_t index = request_.scan().index();
    if (index != next_index_ || index >= record_.scan_crc32c.size()) {
      return absl::OutOfRangeError(index == next_index_
                                       ? absl::StrFormat("scan %d: the session has %d scans", index, next_index_)
                                       : absl::StrFormat("scan %d: expected scan %d", index, next_index_));
    }
    return assembly_.Begin(std::move(*request_.mutable_scan()));
  }

  // Finds the session and what its scans must fit into.
  absl::StatusOr<SessionRecord> OpenSession(grpc::ByteBuffer& message) {
    if (absl::Status status = Decode(message); !status.ok()) return status;
    ++messages_;
    if (request_.part_case() == v1::UploadScansRequest::PART_NOT_SET) return NoPart();
    if (!request_.has_open()) return absl::InvalidArgumentError("the first message must be `open`");
    if (absl::Status status = Gate::Enter(call_, request_); !status.ok()) return status;
    session_ = {request_.open().map(), request_.open().id()};
    if (!slots_.Take(session_, [this] { Stop(); })) {
      return absl::AbortedError(
          absl::StrFormat("session %s of map %s has another upload under way", session_.second, session_.first));
    }
    taken_ = true;
    absl::StatusOr<SessionRecord> session =
        FindSession(context_, call_, Access::kUpload, session_.first, session_.second);
    if (!session.ok()) return session.status();
    if (session->state != SessionState::kUploading) {
      return absl::FailedPreconditionError(absl::StrCat("session ", session->id, " has all its scans"));
    }
    if (absl::Status status = FindRange(*session); !status.ok()) return status;
    return session;
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

  // On the pool of uploads: checks and stages the batch in `staging_`.
  void Stage(uint32_t first) {
    std::vector<PlainScan> scans;
    size_t sent = 0, kept = 0;  // bytes; quotas are of what is kept
    absl::Status bad;
    for (RawScan& raw : std::exchange(staging_, {})) {
      const uint32_t index = raw.header.index();
      if (index == 0 && takes_origin_) {
        if (const auto pose = FromProto(raw.header.pose()); pose.ok()) {
          range_.origin = OriginFor(*pose).value_or(Eigen::Vector3d(Eigen::Vector3d::Zero()));
        }
      }
      const size_t raw_bytes = raw.payload().size(), points_bytes = raw.DecodedBytes();
      auto scan = CheckScan(std::move(raw), record_.scan_crc32c[index], range_);
      if (!scan.ok()) {
        bad = scan.status();
        break;
      }
      scans.push_back(*std::move(scan));
      sent += raw_bytes;
      kept += points_bytes;
      LetOthersRun();
    }
    const size_t count = scans.size();
    absl::Status status = context_.quotas.Append(session_.first, session_.second, kept);
    if (status.ok() && count > 0) {
      status = context_.sessions.AppendScans(session_.first, session_.second, first, std::move(scans));
      if (!status.ok()) Recount();
    }
    if (status.ok() && count > 0) {
      context_.metrics.Staged(count, sent);
      context_.feed.Changed(session_);
    }

    const std::lock_guard lock(mutex_);
    busy_ = false;
    CountPending(-static_cast<int64_t>(std::exchange(staging_bytes_, 0)));
    if (status.ok() && count > 0) {
      record_.durable_scans = first + static_cast<uint32_t>(count);
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

  void CountReceived(int64_t bytes) {
    received_bytes_ += static_cast<size_t>(bytes);
    slots_.AddReceived(bytes);
    CountPending(bytes);
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
    received_.clear();
    CountReceived(-static_cast<int64_t>(received_bytes_));
  }

  // With the mutex held: starts whatever can be started.
  void Proceed() {
    if (finished_) return;
    if (!assembling_ && !received_.empty() && HasRoomForScans()) {
      assembling_ = true;
      if (opened_) {
        context_.staging.Submit([self = self_] { self->Assemble(); });
      } else {
        context_.pool.Submit([self = self_] { self->Open(); });
      }
    }
    if (!busy_ && !pending_.empty()) {
      busy_ = true;
      staging_bytes_ = std::exchange(pending_bytes_, 0);
      staging_ = std::exchange(pending_, {});
      context_.staging.Submit([self = self_, first = record_.durable_scans] { self->Stage(first); });
    }
    const bool all_came = reads_ended_ && !assembling_ && received_.empty();
    if (all_came && !ending_) CheckEnd();
    if (vanished_) acknowledge_ = false;
    if (!writing_ && acknowledge_) {
      acknowledge_ = false;
      writing_ = true;
      v1::UploadScansResponse response;
      response.set_durable_scans(record_.durable_scans);
      response_ = BufferOf(response);
      StartWrite(&response_);
    }
    if ((ending_ || all_came) && !assembling_ && !busy_ && !writing_ && pending_.empty()) {
      finished_ = true;
      // Before the client hears of the end: it may come again at once.
      if (taken_) slots_.Free(session_);
      FinishCall(stream_, *this, failure_.value_or(absl::OkStatus()), Details());
      return;
    }
    const bool awaits_opening = !opened_ && (assembling_ || !received_.empty());
    if (!reading_ && !reads_ended_ && !ending_ && !awaits_opening && HasRoomForMessages()) {
      reading_ = true;
      StartRead(&message_);
    }
  }

  // The client said that it has nothing more.
  void CheckEnd() {
    if (!opened_) {
      Fail(absl::InvalidArgumentError("the stream ended before its first message, `open`"));
    } else if (assembly_.under_way()) {
      Fail(absl::InvalidArgumentError(absl::StrCat("the stream ended while ", assembly_.Description())));
    }
  }

  // One scan may pass the bounds: without its end there is nothing to stage. Beyond that one scan an upload takes part
  // in what all together may hold; its own batch, once durable, makes it look again.
  bool HasRoomForScans() const { return HasRoom(pending_bytes_ + staging_bytes_); }

  bool HasRoomForMessages() const {
    const bool few = received_bytes_ < kMostReceived && slots_.received() < total_limit_ / kShareReceived;
    return (received_bytes_ == 0 || few) && HasRoom(received_bytes_ + pending_bytes_ + staging_bytes_);
  }

  bool HasRoom(size_t held) const { return held == 0 || (held < pending_limit_ && slots_.pending() < total_limit_); }

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
  grpc::ByteBuffer message_, response_;  // being read, being written
  std::deque<grpc::ByteBuffer> received_;
  size_t received_bytes_ = 0;
  // Of opening, then of assembling: whichever is at work.
  v1::UploadScansRequest request_;
  size_t messages_ = 0;  // before this one
  ScanAssembly assembly_;
  uint32_t next_index_ = 0;
  UploadSlots::Key session_;
  SessionRecord record_;          // durable_scans moves with the batches
  MapRange range_;                // of opening, then of staging
  bool takes_origin_ = false;     // the map's origin will be this session's; likewise
  std::vector<RawScan> pending_;  // complete, not given to the pool yet
  std::vector<RawScan> staging_;  // given to it
  size_t pending_bytes_ = 0, staging_bytes_ = 0;
  std::optional<absl::Status> failure_;
  bool wrong_index_ = false;
  bool taken_ = false;                      // the session's slot
  bool opened_ = false;                     // the session is found
  bool reading_ = true, writing_ = false;   // at most one each is in flight
  bool assembling_ = false, busy_ = false;  // opening or assembling, staging is on a pool
  bool acknowledge_ = false;                // durable_scans moved since the last write
  bool reads_ended_ = false, ending_ = false, vanished_ = false, finished_ = false;
};

}  // namespace

Reactor* NewUpload(const ServiceContext& context, grpc::CallbackServerContext& stream, Call call, UploadSlots& slots) {
  return Upload::Begin(context, stream, std::move(call), slots);
}

}  // namespace mapkeep
