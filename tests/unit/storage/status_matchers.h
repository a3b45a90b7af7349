#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <gtest/gtest.h>

#include <ostream>
#include <string>

namespace mapkeep {

inline const absl::Status& StatusOf(const absl::Status& status) { return status; }
template <typename Value>
const absl::Status& StatusOf(const absl::StatusOr<Value>& value) {
  return value.status();
}

/// EXPECT_PRED_FORMAT form of: the outcome has this code.
template <typename Outcome>
testing::AssertionResult HasCode(const char* expression, const char*, const Outcome& outcome, absl::StatusCode code) {
  if (StatusOf(outcome).code() == code) return testing::AssertionSuccess();
  return testing::AssertionFailure() << expression << " gave " << StatusOf(outcome).ToString() << ", not "
                                     << absl::StatusCodeToString(code);
}

}  // namespace mapkeep

#define EXPECT_CODE(outcome, code) EXPECT_PRED_FORMAT2(::mapkeep::HasCode, outcome, absl::StatusCode::code)
#define ASSERT_CODE(outcome, code) ASSERT_PRED_FORMAT2(::mapkeep::HasCode, outcome, absl::StatusCode::code)
#define EXPECT_DONE(outcome) EXPECT_CODE(outcome, kOk)
#define ASSERT_DONE(outcome) ASSERT_CODE(outcome, kOk)
