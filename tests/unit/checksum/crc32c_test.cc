#include "core/checksum/crc32c.h"

#include <gtest/gtest.h>

#include <string>

namespace mapkeep {
namespace {

TEST(Crc32c, MatchesThePublishedVectorsOfRfc3720) {
  EXPECT_EQ(Crc32c(""), 0U);
  EXPECT_EQ(Crc32c("123456789"), 0xe3069283U);
  EXPECT_EQ(Crc32c(std::string(32, '\0')), 0x8a9136aaU);
  EXPECT_EQ(Crc32c(std::string(32, '\xff')), 0x62a8ab43U);
}

TEST(Crc32c, GoesOnFromWhatCameBefore) {
  const std::string whole = "The map is what fleets drive by.";
  for (size_t cut = 0; cut <= whole.size(); ++cut) {
    EXPECT_EQ(Crc32c(whole.substr(cut), Crc32c(whole.substr(0, cut))), Crc32c(whole)) << "cut at " << cut;
  }
}

}  // namespace
}  // namespace mapkeep
