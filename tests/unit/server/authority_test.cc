#include "server/auth/authority.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace mapkeep {
namespace {

class AuthorityTest : public ::testing::Test {
 protected:
  ~AuthorityTest() override { std::filesystem::remove(file_); }

  // As an editor does it: a new file under the old name.
  void Write(const std::string& text) const {
    std::ofstream(file_ + ".new") << text;
    std::filesystem::rename(file_ + ".new", file_);
  }

  static std::string Line(const std::string& name, const std::string& role, const std::string& token) {
    return *TokenLine(name, {role}, {"yard"}, token) + "\n";
  }

  const std::string file_ = absl::StrCat(
      ::testing::TempDir(), "tokens-", ::testing::UnitTest::GetInstance()->current_test_info()->name(), "-", getpid());
};

TEST_F(AuthorityTest, WithoutTokensEverybodyMayDoEverything) {
  const Authority authority;
  EXPECT_FALSE(authority.has_tokens());
  for (const char* header : {"", "Bearer x", "nonsense"}) {
    EXPECT_TRUE(authority.Authorize(header, Access::kOperate, Scope::All()).ok()) << header;
  }
}

TEST_F(AuthorityTest, WhoCannotBeToldIsUnauthenticatedAndWhoMayNotIsDenied) {
  Write(Line("r7", "robot", "secret-7"));
  const auto authority = Authority::Open(file_);
  ASSERT_TRUE(authority.ok()) << authority.status();
  for (const char* header : {"", "Bearer", "Bearer ", "Bearer secret-8", "Basic secret-7", "secret-7"}) {
    const auto caller = (*authority)->Authorize(header, Access::kUpload, Scope::Map("yard"));
    EXPECT_TRUE(absl::IsUnauthenticated(caller.status())) << header;
    EXPECT_FALSE(absl::StrContains(std::string(caller.status().message()), "secret")) << header;
  }
  for (const char* header : {"Bearer secret-7", "bearer secret-7"}) {
    EXPECT_EQ((*authority)->Authorize(header, Access::kUpload, Scope::Map("yard"))->name, "r7");
    EXPECT_TRUE(
        absl::IsPermissionDenied((*authority)->Authorize(header, Access::kOperate, Scope::Map("yard")).status()));
    EXPECT_TRUE(
        absl::IsPermissionDenied((*authority)->Authorize(header, Access::kUpload, Scope::Map("depot")).status()));
  }
}

TEST_F(AuthorityTest, AChangedFileIsTakenUpAndABadOneIsNot) {
  Write(Line("r7", "robot", "old"));
  const auto opened = Authority::Open(file_);
  ASSERT_TRUE(opened.ok());
  Authority& authority = **opened;
  EXPECT_EQ(authority.Reload().value_or(true), false);

  Write(Line("r7", "robot", "new"));
  EXPECT_EQ(authority.Reload().value_or(false), true);
  EXPECT_FALSE(authority.Authenticate("Bearer old").ok());
  EXPECT_TRUE(authority.Authenticate("Bearer new").ok());

  Write("r7 robot yard\n");
  EXPECT_TRUE(absl::IsInvalidArgument(authority.Reload().status()));
  EXPECT_EQ(authority.Reload().value_or(true), false) << "told twice";
  EXPECT_TRUE(authority.Authenticate("Bearer new").ok());

  std::filesystem::remove(file_);
  EXPECT_TRUE(absl::IsUnavailable(authority.Reload().status()));
  EXPECT_TRUE(authority.Authenticate("Bearer new").ok());
}

TEST_F(AuthorityTest, AFileThatIsNotThereOrBadStopsTheStart) {
  EXPECT_TRUE(absl::IsUnavailable(Authority::Open(file_).status()));
  Write("nonsense\n");
  EXPECT_TRUE(absl::IsInvalidArgument(Authority::Open(file_).status()));
}

}  // namespace
}  // namespace mapkeep
