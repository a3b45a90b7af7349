#include "server/auth/access.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace mapkeep {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

Caller Of(Role role, std::vector<std::string> maps = {"*"}) {
  return {.name = "r7", .roles = static_cast<uint8_t>(role), .maps = std::move(maps)};
}

TEST(Access, EachRoleMayWhatItIsForAndNothingElse) {
  struct Row {
    Access access;
    bool robot, reader, operates;
  };
  for (const Row& row : {Row{Access::kRead, false, true, true}, Row{Access::kFollow, true, true, true},
                         Row{Access::kUpload, true, false, true}, Row{Access::kOperate, false, false, true}}) {
    EXPECT_EQ(Allow(Of(Role::kRobot), row.access, Scope::Map("yard")).ok(), row.robot);
    EXPECT_EQ(Allow(Of(Role::kReader), row.access, Scope::Map("yard")).ok(), row.reader);
    EXPECT_EQ(Allow(Of(Role::kOperator), row.access, Scope::Map("yard")).ok(), row.operates);
  }
}

TEST(Access, ATokenIsForItsMapsOnly) {
  const Caller reader = Of(Role::kReader, {"yard", "depot-*"});
  EXPECT_TRUE(reader.May(Access::kRead, "yard"));
  EXPECT_TRUE(reader.May(Access::kRead, "depot-1"));
  EXPECT_TRUE(reader.May(Access::kRead, "depot-"));
  for (const char* other : {"yard2", "yar", "depot", "Depot-1", "", "*"}) {
    EXPECT_FALSE(reader.May(Access::kRead, other)) << other;
    EXPECT_TRUE(absl::IsPermissionDenied(Allow(reader, Access::kRead, Scope::Map(other)))) << other;
  }
}

TEST(Access, WhatIsAboutEveryMapNeedsATokenForEveryMap) {
  EXPECT_TRUE(Allow(Of(Role::kOperator), Access::kOperate, Scope::All()).ok());
  EXPECT_TRUE(absl::IsPermissionDenied(Allow(Of(Role::kOperator, {"a*"}), Access::kOperate, Scope::All())));
  EXPECT_TRUE(Allow(Of(Role::kReader, {"a*"}), Access::kRead, Scope::Any()).ok());
  EXPECT_TRUE(absl::IsPermissionDenied(Allow(Of(Role::kRobot), Access::kRead, Scope::Any())));
}

TEST(Access, ARobotFollowsAndUploadsItsOwnSessionsOnly) {
  const Caller robot = Of(Role::kRobot);
  for (const Access access : {Access::kFollow, Access::kUpload}) {
    EXPECT_TRUE(AllowSession(robot, access, "r7").ok());
    EXPECT_TRUE(absl::IsPermissionDenied(AllowSession(robot, access, "r8")));
    EXPECT_TRUE(absl::IsPermissionDenied(AllowSession(robot, access, "")));
    EXPECT_TRUE(AllowSession(Of(Role::kOperator), access, "r8").ok());
  }
  EXPECT_TRUE(AllowSession(Of(Role::kReader), Access::kFollow, "r8").ok());
  EXPECT_FALSE(AllowSession(Of(Role::kReader), Access::kUpload, "r7").ok());
}

TEST(Access, RolesAddUp) {
  Caller both = Of(Role::kRobot);
  both.roles |= static_cast<uint8_t>(Role::kReader);
  EXPECT_TRUE(both.May(Access::kRead, "yard"));
  EXPECT_TRUE(both.May(Access::kUpload, "yard"));
  EXPECT_TRUE(both.Owns(Access::kFollow, "r8"));
  EXPECT_FALSE(both.Owns(Access::kUpload, "r8"));
}

TEST(Access, ARefusalSaysWhoWhatAndWhere) {
  EXPECT_THAT(std::string(Allow(Of(Role::kRobot), Access::kRead, Scope::Map("yard")).message()),
              AllOf(HasSubstr("r7"), HasSubstr("reader or operator")));
  EXPECT_THAT(std::string(Allow(Of(Role::kReader, {"a"}), Access::kRead, Scope::Map("yard")).message()),
              AllOf(HasSubstr("r7"), HasSubstr("yard")));
  EXPECT_THAT(std::string(AllowSession(Of(Role::kRobot), Access::kUpload, "r8").message()),
              AllOf(HasSubstr("r7"), HasSubstr("r8")));
}

TEST(Access, WithoutTokensAnybodyMayDoEverything) {
  const Caller anybody = Anybody();
  for (const Access access : {Access::kRead, Access::kFollow, Access::kUpload, Access::kOperate}) {
    EXPECT_TRUE(Allow(anybody, access, Scope::Map("yard")).ok());
    EXPECT_TRUE(Allow(anybody, access, Scope::All()).ok());
    EXPECT_TRUE(AllowSession(anybody, access, "").ok());
  }
}

}  // namespace
}  // namespace mapkeep
