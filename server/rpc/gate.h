#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <google/protobuf/message.h>
#include <grpcpp/server_context.h>

#include <string>
#include <string_view>
#include <utility>

#include "server/auth/authority.h"
#include "server/log.h"
#include "server/rpc/grpc_status.h"

namespace mapkeep {

/// A call that was let in: who makes it, and what its log lines carry.
struct Call {
  std::string request_id;  ///< the client's x-request-id, or one made up; also in the trailers of the answer
  Caller caller;
  std::string map, session;  ///< what it is about, where its first message said so

  /// For a LogScope around whatever is done for the call.
  LogTags tags() const;
};

/// What every call passes before anything is done for it: request id, token, role, map (server/rpc/call_rules.h).
/// Whatever has no rule is refused.
class Gate {
 public:
  /// `authority` outlives it.
  explicit Gate(const Authority& authority) : authority_(authority) {}

  /// UNAUTHENTICATED or PERMISSION_DENIED. Of a stream of requests none of which has come yet, `request` is an empty
  /// one: then Enter must follow.
  absl::StatusOr<Call> Admit(grpc::CallbackServerContext& context, const google::protobuf::Message& request) const;

  /// Once the first message of a stream of `Request`s has come. PERMISSION_DENIED.
  static absl::Status Enter(Call& call, const google::protobuf::Message& request);

 private:
  const Authority& authority_;
};

/// A stream that was refused: ends at once.
template <typename Reactor>
class Refused final : public Reactor {
 public:
  explicit Refused(const grpc::Status& status) { this->Finish(status); }
  void OnDone() override { delete this; }
};

/// The reactor that `make` gives for the admitted call, or one that refuses it. For unary calls there is Answer.
template <typename Reactor, typename Make>
Reactor* Admitted(const Gate& gate, grpc::CallbackServerContext& context, const google::protobuf::Message& request,
                  const Make& make) {
  absl::StatusOr<Call> call = gate.Admit(context, request);
  if (!call.ok()) return new Refused<Reactor>(ToGrpc(call.status()));
  return make(*std::move(call));
}

}  // namespace mapkeep
