#include "server/http/content_coding.h"

#include <gtest/gtest.h>

#include <string>

namespace mapkeep {
namespace {

TEST(ContentCoding, TheBestThatTheClientTakes) {
  EXPECT_EQ(BestCoding(""), Coding::kIdentity);
  EXPECT_EQ(BestCoding("gzip, deflate, br, zstd"), Coding::kZstd);
  EXPECT_EQ(BestCoding("gzip, deflate"), Coding::kGzip);
  EXPECT_EQ(BestCoding("zstd;q=0, gzip;q=0.5"), Coding::kGzip);
  EXPECT_EQ(BestCoding("zstd;q=0.1, gzip"), Coding::kGzip);
  EXPECT_EQ(BestCoding("*"), Coding::kZstd);
  EXPECT_EQ(BestCoding("*;q=0"), Coding::kIdentity);
  EXPECT_EQ(BestCoding("identity"), Coding::kIdentity);
  EXPECT_EQ(BestCoding("br;q=x;;,,;q"), Coding::kIdentity);
}

TEST(ContentCoding, TagsTellCodingsApart) {
  EXPECT_EQ(EntityTag("ab", Coding::kIdentity), "\"ab\"");
  EXPECT_EQ(EntityTag("ab", Coding::kGzip), "\"ab-gzip\"");
  EXPECT_TRUE(NamesTag("\"x\", W/\"ab\"", "\"ab\""));
  EXPECT_TRUE(NamesTag("*", "\"ab\""));
  EXPECT_FALSE(NamesTag("\"abc\"", "\"ab\""));
  EXPECT_FALSE(NamesTag("", "\"ab\""));
}

PageResponse Ranged(const std::string& range, const std::string& if_range = "") {
  PageResponse page{.body = std::make_shared<const std::string>("0123456789"), .etag = "\"t\""};
  ApplyRange({.range = range, .if_range = if_range}, page);
  return page;
}

std::string Field(const PageResponse& page, const std::string& name) {
  for (const auto& [field, value] : page.headers) {
    if (field == name) return value;
  }
  return "";
}

TEST(Range, APartOfTheBody) {
  for (const auto& [range, first, count, field] : {std::tuple{"bytes=2-4", 2, 3, "bytes 2-4/10"},
                                                   {"bytes=7-", 7, 3, "bytes 7-9/10"},
                                                   {"bytes=-4", 6, 4, "bytes 6-9/10"},
                                                   {"bytes=0-99", 0, 10, "bytes 0-9/10"},
                                                   {"bytes=-99", 0, 10, "bytes 0-9/10"}}) {
    const PageResponse page = Ranged(range);
    EXPECT_EQ(page.status, 206) << range;
    EXPECT_EQ(page.part, (std::pair<size_t, size_t>(first, count))) << range;
    EXPECT_EQ(Field(page, "Content-Range"), field);
  }
}

TEST(Range, WhatCannotBeHadIsSaid) {
  EXPECT_EQ(Ranged("bytes=10-").status, 416);
  EXPECT_EQ(Field(Ranged("bytes=10-12"), "Content-Range"), "bytes */10");
  EXPECT_EQ(Ranged("bytes=-0").status, 416);
}

TEST(Range, WhatIsNoRangeOrOfAnotherStateGivesTheWhole) {
  for (const char* range : {"", "lines=1-2", "bytes=", "bytes=-", "bytes=4-2", "bytes=1-2,4-5", "bytes=a-b",
                            "bytes=1-b", "bytes=-1-2", "bytes=99999999999999999999-"}) {
    EXPECT_EQ(Ranged(range).status, 200) << range;
  }
  EXPECT_EQ(Ranged("bytes=2-4", "\"other\"").status, 200);
  EXPECT_EQ(Ranged("bytes=2-4", "\"t\"").status, 206);
}

}  // namespace
}  // namespace mapkeep
