#include "client/mapkeep/retry_delay.h"

#include <gtest/gtest.h>

#include <string>
#include <string_view>

namespace mapkeep {
namespace {

/// A field of bytes: its tag, its length in one byte, its bytes.
std::string Field(char tag, std::string_view bytes) {
  std::string field = {tag, static_cast<char>(bytes.size())};
  return field.append(bytes);
}

/// google.rpc.Status{code: 8, details: Any{RetryInfo{2.5 s}}}, byte by byte.
std::string Details(const std::string& type = "type.googleapis.com/google.rpc.RetryInfo") {
  const std::string duration("\x08\x02\x10\x80\xca\xb5\xee\x01", 8);  // seconds 2, nanos 500,000,000
  const std::string any = Field('\x0a', type) + Field('\x12', Field('\x0a', duration));
  return std::string("\x08\x08").append(Field('\x1a', any));
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
