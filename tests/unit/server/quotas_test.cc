#include "server/quota/quotas.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "server/retry_delay.h"

namespace mapkeep {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

SessionRecord Session(const std::string& id, const std::string& robot, SessionState state, uint64_t bytes = 0) {
  SessionRecord session;
  session.map = "yard";
  session.id = id;
  session.robot = robot;
  session.state = state;
  session.staged_bytes = bytes;
  return session;
}

class QuotasTest : public ::testing::Test {
 protected:
  Quotas Of(const QuotaLimits& robot, const QuotaLimits& map) {
    return {robot, map, std::chrono::milliseconds(15000),
            [this](const std::string& quota) { refused_.push_back(quota); }};
  }
  std::vector<std::string> refused_;
};

TEST_F(QuotasTest, ARobotBeginsNoMoreThanItMayAndOthersStillDo) {
  Quotas quotas = Of({.sessions = 2}, {});
  EXPECT_TRUE(quotas.Begin("yard", "a", "r7").ok());
  EXPECT_TRUE(quotas.Begin("depot", "a", "r7").ok());
  const absl::Status full = quotas.Begin("yard", "b", "r7");
  EXPECT_TRUE(absl::IsResourceExhausted(full));
  EXPECT_THAT(std::string(full.message()), AllOf(HasSubstr("robot r7"), HasSubstr("2 sessions"), HasSubstr("15 s")));
  EXPECT_EQ(RetryDelayOf(full), std::chrono::milliseconds(15000));
  EXPECT_TRUE(quotas.Begin("yard", "a", "r7").ok()) << "it is known: begun again, not anew";
  EXPECT_TRUE(quotas.Begin("yard", "b", "r8").ok());
  EXPECT_THAT(refused_, ElementsAre("robot_sessions"));
}

TEST_F(QuotasTest, WhatIsOverMakesRoom) {
  Quotas quotas = Of({.sessions = 1, .jobs = 1}, {});
  ASSERT_TRUE(quotas.Begin("yard", "a", "r7").ok());
  ASSERT_TRUE(quotas.Queue(Session("a", "r7", SessionState::kUploading)).ok());
  EXPECT_TRUE(quotas.Begin("yard", "b", "r7").ok()) << "a is a job now, no open session";
  EXPECT_FALSE(quotas.Queue(Session("b", "r7", SessionState::kUploading)).ok());
  EXPECT_TRUE(quotas.Queue(Session("a", "r7", SessionState::kQueued)).ok()) << "it is one already";
  quotas.Note(Session("a", "r7", SessionState::kCommitted));
  EXPECT_TRUE(quotas.Queue(Session("b", "r7", SessionState::kUploading)).ok());
  quotas.Forget("yard", "b");
  EXPECT_EQ(quotas.Total().jobs, 0);
  EXPECT_TRUE(quotas.Known().empty());
}

TEST_F(QuotasTest, BytesAreThoseOfAllSessionsUnderWay) {
  Quotas quotas = Of({.bytes = 100}, {.bytes = 150});
  ASSERT_TRUE(quotas.Begin("yard", "a", "r7").ok());
  ASSERT_TRUE(quotas.Begin("yard", "b", "r8").ok());
  EXPECT_TRUE(quotas.Append("yard", "a", 100).ok());
  EXPECT_FALSE(quotas.Append("yard", "a", 1).ok());
  EXPECT_TRUE(quotas.Append("yard", "b", 50).ok());
  EXPECT_FALSE(quotas.Append("yard", "b", 1).ok());
  EXPECT_THAT(refused_, ElementsAre("robot_bytes", "map_bytes"));
  EXPECT_EQ(quotas.Total().bytes, 150);
  quotas.Note(Session("a", "r7", SessionState::kRefused, 100));
  EXPECT_TRUE(quotas.Append("yard", "b", 50).ok());
}

TEST_F(QuotasTest, RobotsWithoutANameShareOnlyTheMaps) {
  Quotas quotas = Of({.sessions = 1}, {.sessions = 3});
  for (const char* id : {"a", "b", "c"}) EXPECT_TRUE(quotas.Begin("yard", id, "").ok());
  EXPECT_FALSE(quotas.Begin("yard", "d", "").ok());
  EXPECT_THAT(refused_, ElementsAre("map_sessions"));
}

TEST_F(QuotasTest, AMapThatGoesTakesItsSessionsAlong) {
  Quotas quotas = Of({}, {});
  ASSERT_TRUE(quotas.Begin("yard", "a", "r7").ok());
  ASSERT_TRUE(quotas.Begin("yard", "b", "r7").ok());
  ASSERT_TRUE(quotas.Begin("yard2", "a", "r7").ok());
  quotas.ForgetMap("yard");
  EXPECT_THAT(quotas.Known(), ElementsAre(Quotas::Key("yard2", "a")));
}

TEST_F(QuotasTest, RecordsSayWhatCounts) {
  Quotas quotas = Of({}, {});
  quotas.Note(Session("a", "r7", SessionState::kUploading, 10));
  quotas.Note(Session("b", "r7", SessionState::kRunning, 20));
  quotas.Note(Session("b", "r7", SessionState::kRunning, 20));
  EXPECT_EQ(quotas.Total().sessions, 1);
  EXPECT_EQ(quotas.Total().jobs, 1);
  EXPECT_EQ(quotas.Total().bytes, 30);
  EXPECT_TRUE(quotas.Append("yard", "nobody-knows-it", 5).ok());
  EXPECT_EQ(quotas.Total().bytes, 30);
}

}  // namespace
}  // namespace mapkeep
