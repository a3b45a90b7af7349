#include "server/auth/token_table.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

// SHA-256 of "abc", FIPS 180-2, appendix B.1.
constexpr char kHashOfAbc[] = "sha256:ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

absl::Status Refusal(const std::string& text) { return TokenTable::Parse(text, "tokens").status(); }

TEST(TokenTable, FindsTheCallerOfATokenByItsHash) {
  const auto table =
      TokenTable::Parse(absl::StrCat("# fleet\n\n  r7\trobot,reader yard,depot-*  ", kHashOfAbc, "\r\n"), "tokens");
  ASSERT_TRUE(table.ok()) << table.status();
  EXPECT_EQ(table->size(), 1U);
  const Caller* caller = table->Find("abc");
  ASSERT_NE(caller, nullptr);
  EXPECT_EQ(caller->name, "r7");
  EXPECT_TRUE(caller->Has(Role::kRobot) && caller->Has(Role::kReader) && !caller->Has(Role::kOperator));
  EXPECT_THAT(caller->maps, ElementsAre("yard", "depot-*"));
  for (const char* other : {"", "ab", "abcd", "ABC", kHashOfAbc}) EXPECT_EQ(table->Find(other), nullptr) << other;
}

TEST(TokenTable, ABadLineIsNamedByNumberAndNotShown) {
  const auto complaint = [](const std::string& line) { return std::string(Refusal("\n" + line).message()); };
  EXPECT_THAT(complaint("r7 robot yard"), HasSubstr("tokens:2: 3 words, expected four"));
  EXPECT_THAT(complaint(absl::StrCat("-r robot yard ", kHashOfAbc)), HasSubstr("tokens:2: name"));
  EXPECT_THAT(complaint(absl::StrCat("r7 driver yard ", kHashOfAbc)), HasSubstr("expected robot, reader or operator"));
  EXPECT_THAT(complaint(absl::StrCat("r7 robot, yard ", kHashOfAbc)), HasSubstr("role"));
  EXPECT_THAT(complaint(absl::StrCat("r7 robot a*b ", kHashOfAbc)), HasSubstr("map"));
  EXPECT_THAT(complaint(absl::StrCat("r7 robot yard, ", kHashOfAbc)), HasSubstr("map"));
  for (const char* bad : {"mk_the-token-itself", "sha256:", "sha256:00", "md5:00"}) {
    EXPECT_THAT(complaint(absl::StrCat("r7 robot yard ", bad)), HasSubstr("sha256: and 64 hex digits")) << bad;
    EXPECT_THAT(complaint(absl::StrCat("r7 robot yard ", bad)), Not(HasSubstr("token-itself"))) << bad;
  }
  EXPECT_THAT(complaint(absl::StrCat("a robot x ", kHashOfAbc, "\nb robot x ", kHashOfAbc)),
              HasSubstr("tokens:3: another line has the same hash"));
}

TEST(TokenTable, AFileWithoutLinesLetsNobodyIn) {
  const auto table = TokenTable::Parse("# nobody yet\n", "tokens");
  ASSERT_TRUE(table.ok());
  EXPECT_EQ(table->Find(""), nullptr);
}

TEST(Tokens, NoTwoAreAlikeAndEachFitsAHeader) {
  std::set<std::string> tokens;
  for (int i = 0; i < 100; ++i) {
    const auto token = NewToken();
    ASSERT_TRUE(token.ok());
    EXPECT_EQ(token->size(), 46U);
    EXPECT_EQ(token->find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-"),
              std::string::npos);
    EXPECT_TRUE(tokens.insert(*token).second);
  }
}

TEST(Tokens, TheLineOfATokenGivesItsCallerAndHidesTheToken) {
  const std::string token = *NewToken();
  const auto line = TokenLine("r7", {"robot", "reader"}, {"yard", "d*"}, token);
  ASSERT_TRUE(line.ok());
  EXPECT_FALSE(absl::StrContains(*line, token));
  const auto table = TokenTable::Parse(*line, "tokens");
  ASSERT_TRUE(table.ok()) << table.status();
  ASSERT_NE(table->Find(token), nullptr);
  EXPECT_EQ(table->Find(token)->name, "r7");
  EXPECT_FALSE(TokenLine("r 7", {"robot"}, {"*"}, token).ok());
  EXPECT_FALSE(TokenLine("r7", {"root"}, {"*"}, token).ok());
  EXPECT_FALSE(TokenLine("r7", {"robot"}, {"a b"}, token).ok());
  EXPECT_FALSE(TokenLine("r7", {}, {"*"}, token).ok());
}

}  // namespace
}  // namespace mapkeep
