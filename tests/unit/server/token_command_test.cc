#include "server/token_command.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "server/auth/authority.h"

namespace mapkeep {
namespace {

absl::StatusOr<std::string> Token(std::vector<const char*> words) {
  words.insert(words.begin(), "token");
  return MakeToken(static_cast<int>(words.size()), words.data());
}

TEST(TokenCommand, PrintsATokenAndTheLineThatLetsItIn) {
  const auto text = Token({"r7", "--role", "robot", "--role", "reader", "--map", "yard,depot-*"});
  ASSERT_TRUE(text.ok()) << text.status();
  const std::vector<std::string> lines = absl::StrSplit(*text, '\n');
  ASSERT_EQ(lines.size(), 3U);  // the last one is empty
  const auto table = TokenTable::Parse(lines[1], "tokens");
  ASSERT_TRUE(table.ok()) << table.status();
  ASSERT_NE(table->Find(lines[0]), nullptr);
  EXPECT_TRUE(table->Find(lines[0])->May(Access::kUpload, "depot-3"));
}

TEST(TokenCommand, AppendsToAFileThatNobodyElseReads) {
  const std::string file = absl::StrCat(::testing::TempDir(), "appended-", getpid());
  const auto first = Token({"r7", "--role", "robot", "--map", "yard", "--append", file.c_str()});
  ASSERT_TRUE(first.ok()) << first.status();
  struct stat made {};
  stat(file.c_str(), &made);
  EXPECT_EQ(made.st_mode & 0777, 0600U);
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 1);  // an editor that leaves the end out
  const auto second = Token({"ops", "--role", "operator", "--map", "*", "--append", file.c_str()});
  ASSERT_TRUE(second.ok()) << second.status();
  const auto authority = Authority::Open(file);
  ASSERT_TRUE(authority.ok()) << authority.status();
  EXPECT_EQ((*authority)->Authenticate("Bearer " + first->substr(0, first->size() - 1))->name, "r7");
  EXPECT_EQ((*authority)->Authenticate("Bearer " + second->substr(0, second->size() - 1))->name, "ops");
  std::filesystem::remove(file);
}

TEST(TokenCommand, SaysWhatIsMissingOrWrong) {
  EXPECT_TRUE(absl::IsInvalidArgument(Token({"r7", "--map", "yard"}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(Token({"r7", "--role", "robot"}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(Token({"r7", "--role", "king", "--map", "yard"}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(Token({"r 7", "--role", "robot", "--map", "yard"}).status()));
  EXPECT_TRUE(
      absl::IsUnavailable(Token({"r7", "--role", "robot", "--map", "yard", "--append", "/nowhere/tokens"}).status()));
}

}  // namespace
}  // namespace mapkeep
