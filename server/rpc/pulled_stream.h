#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/support/server_callback.h>

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "server/rpc/grpc_status.h"
#include "server/work_pool.h"

namespace mapkeep {

/// What came of asking for the next message.
enum class Pulled {
  kMore,     ///< a message, and perhaps others after it
  kLast,     ///< a message, and the end
  kNothing,  ///< no message: the end
  kNotYet,   ///< no message: ask again, unless nobody wants it any more
};

/// A server stream that is pulled: `next`, on the pool, fills the next message while the one before it is written, and
/// waits for that; so a slow reader costs two messages. Whoever is done last passes it on, without a detour over the
/// pool: most streams are short, and somebody waits for them. Deletes itself.
template <typename Response>
class PulledStream final : public grpc::ServerWriteReactor<Response> {
 public:
  using Next = std::function<absl::StatusOr<Pulled>(Response&)>;

  PulledStream(WorkPool& pool, Next next) : pool_(pool), next_(std::move(next)) {}

  static PulledStream* Start(WorkPool& pool, Next next) {
    auto stream = std::make_shared<PulledStream>(pool, std::move(next));
    stream->self_ = stream;
    const std::lock_guard lock(stream->mutex_);
    stream->Proceed();
    return stream.get();
  }

  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    if (!ok) cancelled_ = true;
    Proceed();
  }
  void OnCancel() override {
    const std::lock_guard lock(mutex_);
    cancelled_ = true;
    Proceed();
  }
  void OnDone() override { const std::shared_ptr<PulledStream> last = std::move(self_); }

 private:
  // On the pool: makes messages until one has to wait.
  void Make() {
    bool goes_on = true;
    while (goes_on) {
      made_.Clear();
      const absl::StatusOr<Pulled> pulled = next_(made_);
      const std::lock_guard lock(mutex_);
      if (!pulled.ok()) {
        end_ = ToGrpc(pulled.status());
      } else if (*pulled == Pulled::kLast || *pulled == Pulled::kNothing) {
        end_ = grpc::Status::OK;
      }
      ready_ = pulled.ok() && (*pulled == Pulled::kMore || *pulled == Pulled::kLast);
      Write();
      goes_on = !ready_ && !end_ && !cancelled_;
      if (!goes_on) {
        making_ = false;
        Proceed();
      }
    }
  }

  // With the mutex held: writes what is ready, if nothing is being written.
  void Write() {
    if (!ready_ || writing_ || cancelled_) return;
    ready_ = false;
    writing_ = true;
    std::swap(made_, written_);
    if (end_) {
      finished_ = true;
      this->StartWriteAndFinish(&written_, {}, *end_);
    } else {
      this->StartWrite(&written_);
    }
  }

  // With the mutex held: starts whatever can be started.
  void Proceed() {
    if (finished_) return;
    if (!making_) Write();
    if (finished_ || making_) return;
    if (!writing_ && (cancelled_ || (end_ && !ready_))) {
      finished_ = true;
      this->Finish(cancelled_ ? grpc::Status(grpc::StatusCode::CANCELLED, "the client went away") : *end_);
    } else if (!ready_ && !end_ && !cancelled_) {
      making_ = true;
      pool_.Submit([self = self_] { self->Make(); });
    }
  }

  WorkPool& pool_;
  const Next next_;
  std::shared_ptr<PulledStream> self_;
  std::mutex mutex_;
  Response made_, written_;  // made_ is Make's while it is at work
  bool making_ = false;      // Make is on the pool
  bool ready_ = false;       // made_ waits to be written
  bool writing_ = false;     // one is in flight
  bool cancelled_ = false, finished_ = false;
  std::optional<grpc::Status> end_;  // after made_, if that is ready
};

}  // namespace mapkeep
