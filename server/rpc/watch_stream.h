#pragma once

#include <absl/status/status.h>
#include <grpcpp/alarm.h>
#include <grpcpp/support/server_callback.h>

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "server/rpc/context.h"
#include "server/rpc/grpc_status.h"

namespace mapkeep {

/// What a look at something watched found.
struct Seen {
  bool news = false;                ///< the message is to be written
  bool more = false;                ///< and there is to be another look once it is
  std::optional<absl::Status> end;  ///< how the call ends after that
};

/// A server stream that tells what changes: looks, on the pool, at the beginning and after each change (changes that
/// come while a message is on its way are one), until a look ends it, the client goes or limits.watch_seconds are over.
/// Deletes itself.
template <typename Response>
class WatchStream final : public grpc::ServerWriteReactor<Response> {
 public:
  /// One at a time; never while its message of before is being written.
  using Look = std::function<Seen(Response&)>;
  /// Has `changed` called after each change from now on, without blocking. What it returns ends that, and is called
  /// once: `changed` is not running then and will not be called again.
  using Follow = std::function<std::function<void()>(std::function<void()> changed)>;

  WatchStream(WorkPool& pool, Look look) : pool_(pool), look_(std::move(look)) {}

  // Lives until the call is done and the pool no longer means it.
  static WatchStream* Start(const ServiceContext& context, const Follow& follow, Look look) {
    auto watch = std::make_shared<WatchStream>(context.pool, std::move(look));
    watch->self_ = watch;
    watch->leave_ = follow([of = watch.get()] { of->Changed(); });
    const auto end = std::chrono::system_clock::now() + std::chrono::seconds(context.config.limits.watch_seconds);
    // Weak: the alarm keeps its callback for as long as it lives itself.
    watch->alarm_.Set(end, [weak = std::weak_ptr<WatchStream>(watch)](bool) {
      const std::shared_ptr<WatchStream> of = weak.lock();
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
    leave_();
    alarm_.Cancel();
    const std::shared_ptr<WatchStream> last = std::move(self_);
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
  void LookNow() {
    const Seen seen = look_(response_);
    const std::lock_guard lock(mutex_);
    looking_ = false;
    if (seen.news && !end_) {
      writing_ = true;
      this->StartWrite(&response_);
    }
    if (seen.more) changed_ = true;
    if (!end_) end_ = seen.end;
    Proceed();
  }

  // With the mutex held.
  void Proceed() {
    if (looking_ || writing_ || finished_) return;
    if (end_) {
      finished_ = true;
      this->Finish(ToGrpc(*end_));
    } else if (changed_) {
      changed_ = false;
      looking_ = true;
      pool_.Submit([self = self_] { self->LookNow(); });
    }
  }

  WorkPool& pool_;
  const Look look_;
  std::shared_ptr<WatchStream> self_;
  std::function<void()> leave_;
  grpc::Alarm alarm_;
  Response response_;  // the look's while it is at work, else what is being written

  std::mutex mutex_;
  bool changed_ = false, looking_ = false, writing_ = false, finished_ = false;
  std::optional<absl::Status> end_;  // how the call ends once nothing is on its way
};

}  // namespace mapkeep
