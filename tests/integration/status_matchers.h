#pragma once

#include <gmock/gmock.h>
#include <grpcpp/support/status.h>

namespace mapkeep {

MATCHER(IsOk, "") {
  *result_listener << arg.error_code() << ": " << arg.error_message();
  return arg.ok();
}

/// The code, and every word somewhere in the message.
MATCHER_P2(Fails, code, words, "") {
  *result_listener << arg.error_code() << ": " << arg.error_message();
  if (arg.error_code() != code) return false;
  for (const std::string& word : words) {
    if (arg.error_message().find(word) == std::string::npos) return false;
  }
  return true;
}

inline auto FailsWith(grpc::StatusCode code, std::vector<std::string> words) { return Fails(code, words); }

}  // namespace mapkeep
