#include "server/names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

TEST(Names, AreLettersDigitsAndAFewSignsBeginningWithALetterOrDigit) {
  for (const char* good : {"a", "7", "site", "Day-1", "2026:11:23", "a.b_c-d:e"}) {
    EXPECT_TRUE(CheckName("map name", good).ok()) << good;
  }
  EXPECT_TRUE(CheckName("map name", std::string(128, 'x')).ok());
  for (const std::string& bad :
       {std::string(), std::string("../x"), std::string("-a"), std::string("a b"), std::string("a/b"),
        std::string("caf\xc3\xa9"), std::string("a\0b", 3), std::string(129, 'x')}) {
    const absl::Status status = CheckName("map name", bad);
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << bad;
    EXPECT_THAT(std::string(status.message()), HasSubstr("map name"));
  }
}

TEST(Names, OnlyAnOptionalOneMayBeEmpty) {
  EXPECT_TRUE(CheckOptionalName("robot", "").ok());
  EXPECT_FALSE(CheckOptionalName("robot", " ").ok());
}

TEST(Names, AReferenceSystemIsAnEpsgNumberOrNothing) {
  EXPECT_TRUE(CheckCrs("").ok());
  EXPECT_TRUE(CheckCrs("EPSG:25832").ok());
  for (const char* bad : {"EPSG:", "EPSG:x", "epsg:25832", "25832", "EPSG:1234567", "EPSG:12 "}) {
    EXPECT_FALSE(CheckCrs(bad).ok()) << bad;
  }
}

}  // namespace
}  // namespace mapkeep
