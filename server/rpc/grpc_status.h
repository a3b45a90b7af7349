#pragma once

#include <absl/status/status.h>
#include <grpcpp/support/status.h>

#include <string>

namespace mapkeep {

/// The same code and message (the codes are the same numbers), with `details` for the client to parse.
inline grpc::Status ToGrpc(const absl::Status& status, const std::string& details = "") {
  return {static_cast<grpc::StatusCode>(status.code()), std::string(status.message()), details};
}

}  // namespace mapkeep
