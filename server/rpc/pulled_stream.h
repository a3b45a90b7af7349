#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/support/server_callback.h>

#include <atomic>
#include <functional>
#include <utility>

#include "server/rpc/grpc_status.h"
#include "server/work_pool.h"

namespace mapkeep {

/// A server stream that is pulled: alternates between `next` on the pool, which fills the next message, and its write;
/// never both, so a slow reader costs one message. `next` gives false at the end. Deletes itself.
template <typename Response>
class PulledStream final : public grpc::ServerWriteReactor<Response> {
 public:
  using Next = std::function<absl::StatusOr<bool>(Response&)>;

  PulledStream(WorkPool& pool, Next next) : pool_(pool), next_(std::move(next)) {
    pool_.Submit([this] { Step(); });
  }

  void OnWriteDone(bool ok) override {
    if (ok && !cancelled_) {
      pool_.Submit([this] { Step(); });
    } else {
      this->Finish(grpc::Status(grpc::StatusCode::CANCELLED, "the client went away"));
    }
  }
  void OnCancel() override { cancelled_ = true; }
  void OnDone() override { delete this; }

 private:
  void Step() {
    if (cancelled_) return this->Finish(grpc::Status(grpc::StatusCode::CANCELLED, "the client went away"));
    response_.Clear();
    const absl::StatusOr<bool> more = next_(response_);
    if (!more.ok()) return this->Finish(ToGrpc(more.status()));
    if (!*more) return this->Finish(grpc::Status::OK);
    this->StartWrite(&response_);
  }

  WorkPool& pool_;
  const Next next_;
  std::atomic<bool> cancelled_ = false;
  Response response_;
};

}  // namespace mapkeep
