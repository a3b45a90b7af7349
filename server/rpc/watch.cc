#include "server/rpc/watch.h"

#include <grpcpp/alarm.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "server/rpc/convert.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/sessions.h"

namespace mapkeep {
namespace {

using Reactor = grpc::ServerWriteReactor<v1::WatchSessionResponse>;

class Watch final : public Reactor {
 public:
  Watch(const ServiceContext& context, Call call)
      : context_(context), call_(std::move(call)), session_(call_.map, call_.session) {}

  // Lives until the call is done and the pool no longer means it.
  static Watch* Begin(const ServiceContext& context, Call call) {
    auto watch = std::make_shared<Watch>(context, std::move(call));
    watch->self_ = watch;
    watch->watcher_ = context.feed.Watch(watch->session_, [of = watch.get()] { of->Changed(); });
    const auto end = std::chrono::system_clock::now() + std::chrono::seconds(context.config.limits.watch_seconds);
    // Weak: the alarm keeps its callback for as long as it lives itself.
    watch->alarm_.Set(end, [weak = std::weak_ptr<Watch>(watch)](bool) {
      const std::shared_ptr<Watch> of = weak.lock();
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
    context_.feed.Unwatch(watcher_);
    alarm_.Cancel();
    const std::shared_ptr<Watch> last = std::move(self_);
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

  // On the pool.
  void Look() {
    const auto session = FindSession(context_, call_, Access::kFollow, session_.first, session_.second);
    const bool closed = context_.feed.closed();
    const auto progress = context_.feed.Progress(session_);
    const std::lock_guard lock(mutex_);
    looking_ = false;
    if (!session.ok()) {
      if (!end_) end_ = session.status();
    } else if (!end_) {
      *response_.mutable_session() = ToProto(*session, progress);
      std::string now = response_.SerializeAsString();
      if (now != told_) {  // whoever looks elsewhere finds the same most of the time
        told_ = std::move(now);
        writing_ = true;
        StartWrite(&response_);
      }
      if (HasEnded(session->state)) {
        end_ = absl::OkStatus();
      } else if (closed) {
        end_ = absl::UnavailableError("the daemon is stopping; watch again");
      }
    }
    Proceed();
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
  const Call call_;
  const SessionFeed::Key session_;
  std::shared_ptr<Watch> self_;
  SessionFeed::Watcher watcher_ = 0;
  grpc::Alarm alarm_;

  std::mutex mutex_;
  v1::WatchSessionResponse response_;
  std::string told_;  // the last one, as bytes
  bool changed_ = false, looking_ = false, writing_ = false, finished_ = false;
  std::optional<absl::Status> end_;  // how the call ends once nothing is on its way
};

}  // namespace

Reactor* NewWatch(const ServiceContext& context, Call call) { return Watch::Begin(context, std::move(call)); }

}  // namespace mapkeep
