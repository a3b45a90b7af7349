#include "client/mapkeep/retry_delay.h"

#include <gtest/gtest.h>

namespace mapkeep {
namespace {

/// google.rpc.Status{code: 8, details: Any{RetryInfo{2.5 s}}}, byte by byte.
std::string Details(const std::string& type = "type.googleapis.com/google.rpc.RetryInfo") {
  const std::string duration("\x08\x02\x10\x80\xca\xb5\xee\x01", 8);  // seconds 2, nanos 500,000,000
  const std::string info = "\x0a" + std::string(1, static_cast<char>(duration.size())) + duration;
  std::string any = "\x0a" + std::string(1, static_cast<char>(type.size())) + type;
  any += "\x12" + std::string(1, static_cast<char>(info.size())) + info;
  return "\x08\x08\x1a" + std::string(1, static_cast<char>(any.size())) + any;
}

TEST(RetryDelay, IsReadFromTheDetailsOfAnError) {
  EXPECT_EQ(RetryDelayIn(Details()), absl::Seconds(2.5));
  EXPECT_EQ(RetryDelayIn(Details("type.googleapis.com/google.rpc.Help")), std::nullopt);
  EXPECT_EQ(RetryDelayIn(""), std::nullopt);
  const std::string details = Details();
  for (size_t size = 0; size < details.size(); ++size) EXPECT_EQ(RetryDelayIn(details.substr(0, size)), std::nullopt);
}

TEST(RetryDelay, StaysWithItsError) {
  const absl::Status full = KeepRetryDelay(absl::ResourceExhaustedError("full"), absl::Seconds(3));
  EXPECT_EQ(KeptRetryDelay(full), absl::Seconds(3));
  EXPECT_EQ(KeptRetryDelay(absl::ResourceExhaustedError("full")), std::nullopt);
}

}  // namespace
}  // namespace mapkeep
