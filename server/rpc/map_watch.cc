#include "server/rpc/map_watch.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_split.h>
#include <grpcpp/alarm.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "server/names.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/paging.h"

namespace mapkeep {
namespace {

using Reactor = grpc::ServerWriteReactor<v1::WatchMapResponse>;

// Farther back, reading every commit takes longer than comparing tiles.
constexpr uint64_t kMostEpochsBehind = 1000;

std::string TokenOf(const MapHead& head) { return PageToken(absl::StrFormat("%x.%d", head.incarnation, head.epoch)); }

absl::StatusOr<MapHead> HeadOf(const std::string& token) {
  const absl::Status bad = absl::InvalidArgumentError("resume_token: expected one from an earlier answer");
  const absl::StatusOr<std::string> position = PositionOf(token);
  if (!position.ok()) return bad;
  const std::vector<std::string> parts = absl::StrSplit(*position, '.');
  MapHead head;
  if (parts.size() != 2 || !absl::SimpleHexAtoi(parts[0], &head.incarnation) ||
      !absl::SimpleAtoi(parts[1], &head.epoch)) {
    return bad;
  }
  return head;
}

class MapWatch final : public Reactor {
 public:
  MapWatch(const ServiceContext& context, const v1::WatchMapRequest& request)
      : context_(context), map_(request.map()), token_(request.resume_token()) {}

  // Lives until the call is done and the pool no longer means it.
  static MapWatch* Begin(const ServiceContext& context, const v1::WatchMapRequest& request) {
    auto watch = std::make_shared<MapWatch>(context, request);
    watch->self_ = watch;
    watch->watcher_ = context.epochs.Watch(watch->map_, [of = watch.get()] { of->Changed(); });
    const auto end = std::chrono::system_clock::now() + std::chrono::seconds(context.config.limits.watch_seconds);
    // Weak: the alarm keeps its callback for as long as it lives itself.
    watch->alarm_.Set(end, [weak = std::weak_ptr<MapWatch>(watch)](bool) {
      const std::shared_ptr<MapWatch> of = weak.lock();
      if (of == nullptr) return;
      const std::lock_guard lock(of->mutex_);
      of->End(absl::OkStatus());
    });
    watch->Changed();
    return watch.get();
  }

  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    if (!ok) End(absl::CancelledError("the client went away"));
    Proceed();
  }

  void OnCancel() override {
    const std::lock_guard lock(mutex_);
    End(absl::CancelledError("the client went away"));
  }

  void OnDone() override {
    context_.epochs.Unwatch(watcher_);
    alarm_.Cancel();
    const std::shared_ptr<MapWatch> last = std::move(self_);
  }

 private:
  void Changed() {
    const std::lock_guard lock(mutex_);
    changed_ = true;
    Proceed();
  }

  void End(const absl::Status& status) {
    if (!end_) end_ = status;
    Proceed();
  }

  // On the pool: writes the next epoch there is to tell.
  void Look() {
    const absl::StatusOr<bool> news = NextMessage();
    const bool closed = context_.epochs.closed();
    const std::lock_guard lock(mutex_);
    looking_ = false;
    if (!news.ok()) {
      if (!end_) end_ = news.status();
    } else if (!end_ && *news) {
      changed_ = true;  // there may be more
      writing_ = true;
      StartWrite(&response_);
    }
    if (closed && !end_) end_ = absl::UnavailableError("the daemon is stopping; watch again");
    Proceed();
  }

  // False if everything was told.
  absl::StatusOr<bool> NextMessage() {
    if (!at_) {
      if (absl::Status status = CheckName("map name", map_); !status.ok()) return status;
      const absl::StatusOr<MapHead> from = token_.empty() ? MapHead() : HeadOf(token_);
      if (!from.ok()) return from.status();
      at_ = *from;
    }
    const absl::StatusOr<MapHead> head = context_.maps.Head(map_);
    if (!head.ok()) return head.status();
    if (*head == *at_) return false;
    response_.Clear();
    if (head->incarnation != at_->incarnation || head->epoch < at_->epoch ||
        head->epoch - at_->epoch > kMostEpochsBehind) {
      response_.set_any_tile(true);
      response_.set_epoch(head->epoch);
      at_ = *head;
      response_.set_resume_token(TokenOf(*at_));
      return true;
    }
    const auto commits = context_.maps.CommitsAfter(map_, *at_, 1);
    if (!commits.ok()) return commits.status();
    if (commits->empty()) return false;
    const CommitRecord& commit = commits->front();
    response_.set_epoch(commit.epoch);
    response_.set_session(commit.session);
    response_.set_rollback(commit.rollback);
    for (const TileKey key : commit.touched_tiles) {
      const VoxelIndex tile = TileIndexOf(key);
      v1::TileId& id = *response_.add_touched_tiles();
      id.set_x(tile.x);
      id.set_y(tile.y);
    }
    at_->epoch = commit.epoch;
    response_.set_resume_token(TokenOf(*at_));
    return true;
  }

  // With the mutex held.
  void Proceed() {
    if (looking_ || writing_ || finished_) return;
    if (end_) {
      finished_ = true;
      Finish(ToGrpc(*end_));
    } else if (changed_) {
      changed_ = false;
      looking_ = true;
      context_.pool.Submit([self = self_] { self->Look(); });
    }
  }

  const ServiceContext context_;
  const std::string map_, token_;
  std::shared_ptr<MapWatch> self_;
  EpochFeed::Watcher watcher_ = 0;
  grpc::Alarm alarm_;
  std::optional<MapHead> at_;  // what was told last; pool only
  v1::WatchMapResponse response_;

  std::mutex mutex_;
  bool changed_ = false, looking_ = false, writing_ = false, finished_ = false;
  std::optional<absl::Status> end_;  // how the call ends once nothing is on its way
};

}  // namespace

Reactor* NewMapWatch(const ServiceContext& context, const v1::WatchMapRequest& request) {
  return MapWatch::Begin(context, request);
}

}  // namespace mapkeep
