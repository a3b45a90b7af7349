#include "storage/session_store.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstring>
#include <random>
#include <set>
#include <thread>

#include "core/checksum/crc32c.h"
#include "storage/scan_codec.h"
#include "tests/unit/storage/status_matchers.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

StagedScan AnyScan(uint64_t seed, size_t points = 100) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<float> any(-100, 100);
  StagedScan staged;
  for (size_t i = 0; i < points; ++i) {
    staged.scan.points.emplace_back(any(random), any(random), any(random));
    staged.scan.intensities.push_back(any(random));
  }
  staged.scan.time = 1.0 / 3 + static_cast<double>(seed);
  staged.pose.translation() = Eigen::Vector3d(any(random), any(random), any(random));
  staged.pose.linear() = Eigen::AngleAxisd(any(random), Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  return staged;
}

template <typename Values>
bool SameBits(const Values& a, const Values& b) {
  if (a.size() != b.size()) return false;
  return a.size() == 0 || std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0;
}

void ExpectSame(const StagedScan& a, const StagedScan& b) {
  EXPECT_TRUE(SameBits(a.scan.points, b.scan.points));
  EXPECT_TRUE(SameBits(a.scan.intensities, b.scan.intensities));
  EXPECT_EQ(a.scan.time, b.scan.time);
  EXPECT_TRUE(SameBits(RowsOf(a.pose), RowsOf(b.pose)));
}

class SessionStoreTest : public testing::Test {
 protected:
  SessionRecord Session(const std::string& id, std::vector<uint32_t> scans, double created = 1,
                        const std::string& map = "m") {
    return {.map = map, .id = id, .robot = "r", .scan_crc32c = std::move(scans), .created = created};
  }

  /// A session with all of `count` scans staged.
  SessionRecord Upload(const std::string& id, uint32_t count, double created = 1, const std::string& map = "m") {
    EXPECT_DONE(sessions_->Begin(Session(id, std::vector<uint32_t>(count, 7), created, map)));
    std::vector<StagedScan> scans;
    for (uint32_t i = 0; i < count; ++i) scans.push_back(AnyScan(i));
    EXPECT_DONE(sessions_->AppendScans(map, id, 0, scans));
    return *sessions_->Find(map, id);
  }

  absl::Status Move(const std::string& id, SessionState from, SessionState to, const std::string& map = "m") {
    SessionRecord record = *sessions_->Find(map, id);
    record.state = to;
    return sessions_->Update(record, from);
  }

  TestEngine engine_;
  std::unique_ptr<SessionStore> sessions_ = OpenSessionStore(*engine_);
};

TEST(ScanCodec, AScanComesBackBitForBit) {
  StagedScan staged = AnyScan(1, 1000);
  staged.scan.points[0] = {-0.0F, 1e-40F, 3.0F};  // a negative zero and a denormal number
  const auto expect_same = [&staged] {
    for (const ScanForm form : {ScanForm::kPacked, ScanForm::kPlain}) {
      ExpectSame(*DecodeScan(*EncodeScan(staged, form)), staged);
    }
  };
  expect_same();
  staged.scan.intensities.clear();
  expect_same();
  staged.scan.points.clear();
  expect_same();
}

TEST(ScanCodec, PointsAsTheyCameInBecomeThePlainValueOfTheirScan) {
  const StagedScan staged = AnyScan(3, 50);
  const std::string plain = *EncodeScan(staged, ScanForm::kPlain);
  std::string value = std::string(kScanContentAt, 'x') + plain.substr(kScanContentAt);
  SealPlainScan(value, staged.scan.time, staged.pose, Crc32c(plain.substr(kScanContentAt)));
  EXPECT_EQ(value, plain);
  EXPECT_EQ(PointsIn(value), 50U);
  EXPECT_EQ(*PackScan(value), *EncodeScan(staged, ScanForm::kPacked));
}

TEST(ScanCodec, EveryFlippedBitAndTruncationIsNoticed) {
  for (const ScanForm form : {ScanForm::kPacked, ScanForm::kPlain}) {
    const std::string value = *EncodeScan(AnyScan(2, 20), form);
    for (size_t at = 0; at < value.size(); ++at) {
      for (int bit = 0; bit < 8; ++bit) {
        std::string damaged = value;
        damaged[at] = static_cast<char>(damaged[at] ^ (1 << bit));
        ASSERT_CODE(DecodeScan(damaged), kDataLoss) << "byte " << at << " bit " << bit;
      }
      ASSERT_CODE(DecodeScan(std::string_view(value).substr(0, at)), kDataLoss) << at;
    }
  }
}

TEST_F(SessionStoreTest, TheSameSessionBegunAgainGoesOnAndAnotherIsRefused) {
  ASSERT_DONE(sessions_->Begin(Session("s", {1, 2, 3})));
  ASSERT_DONE(sessions_->AppendScans("m", "s", 0, std::vector{AnyScan(1)}));
  const auto again = sessions_->Begin(Session("s", {1, 2, 3}));
  ASSERT_DONE(again);
  EXPECT_EQ(again->durable_scans, 1U);
  EXPECT_THAT(again->scan_crc32c, ElementsAre(1, 2, 3));
  EXPECT_EQ(again->robot, "r");
  const absl::Status shorter = sessions_->Begin(Session("s", {1, 2})).status();
  EXPECT_CODE(shorter, kAlreadyExists);
  const absl::Status other = sessions_->Begin(Session("s", {1, 9, 3})).status();
  EXPECT_CODE(other, kAlreadyExists);
  EXPECT_THAT(std::string(other.message()), HasSubstr("scan 1"));
  EXPECT_CODE(sessions_->Find("m", "none"), kNotFound);
  EXPECT_CODE(sessions_->Find("other map", "s"), kNotFound);
}

TEST_F(SessionStoreTest, ScansAreStagedInOrderAndReadBack) {
  ASSERT_DONE(sessions_->Begin(Session("s", {1, 2, 3})));
  std::vector<StagedScan> scans = {AnyScan(1), AnyScan(2), AnyScan(3)};
  scans[0].payload_bytes = 100;
  scans[2].payload_bytes = 20;
  const std::span<const StagedScan> all(scans);
  EXPECT_CODE(sessions_->AppendScans("m", "s", 1, all.subspan(1)), kOutOfRange);
  EXPECT_DONE(sessions_->AppendScans("m", "s", 0, all.first(2)));
  EXPECT_CODE(sessions_->AppendScans("m", "s", 0, all.first(2)), kOutOfRange);
  EXPECT_CODE(sessions_->AppendScans("m", "s", 2, all.first(2)), kOutOfRange) << "beyond the last";
  EXPECT_CODE(sessions_->ReadScan("m", "s", 2), kNotFound);
  EXPECT_DONE(sessions_->AppendScans("m", "s", 2, all.subspan(2)));
  sessions_.reset();
  engine_.Reopen();
  sessions_ = OpenSessionStore(*engine_);
  EXPECT_EQ(sessions_->Find("m", "s")->durable_scans, 3U);
  EXPECT_EQ(sessions_->Find("m", "s")->payload_bytes, 120U) << "once each, whatever was refused";
  for (uint32_t i = 0; i < 3; ++i) ExpectSame(*sessions_->ReadScan("m", "s", i), scans[i]);
}

TEST_F(SessionStoreTest, NothingIsStagedOnceASessionIsQueued) {
  Upload("s", 1);
  ASSERT_DONE(Move("s", SessionState::kUploading, SessionState::kQueued));
  EXPECT_CODE(sessions_->AppendScans("m", "s", 1, std::vector{AnyScan(1)}), kFailedPrecondition);
}

TEST_F(SessionStoreTest, AStateChangesOnlyFromTheOneExpected) {
  Upload("s", 2);
  EXPECT_CODE(Move("s", SessionState::kQueued, SessionState::kRunning), kAborted);
  EXPECT_DONE(Move("s", SessionState::kUploading, SessionState::kQueued));
  SessionRecord record = *sessions_->Find("m", "s");
  record.state = SessionState::kRefused;
  record.reason = "no window fits";
  record.ended = 77;
  record.start_time = 5;
  record.durable_scans = 0;
  record.scan_crc32c.clear();
  record.report.windows = {
      {.first_scan = 1, .last_scan = 2, .fitness = 0.5, .inliers = 9, .correction = 1, .trusted = true}};
  record.report.stages = {{"align", 1.5}};
  record.report.points = 10;
  EXPECT_DONE(sessions_->Update(record, SessionState::kQueued));
  const SessionRecord found = *sessions_->Find("m", "s");
  EXPECT_EQ(found.state, SessionState::kRefused);
  EXPECT_EQ(found.reason, "no window fits");
  EXPECT_EQ(found.ended, 77);
  EXPECT_EQ(found.start_time, 5);
  EXPECT_EQ(found.durable_scans, 2U) << "the store's own";
  EXPECT_EQ(found.scan_crc32c.size(), 2U) << "the store's own";
  ASSERT_EQ(found.report.windows.size(), 1U);
  EXPECT_EQ(found.report.windows[0].inliers, 9U);
  ASSERT_EQ(found.report.stages.size(), 1U);
  EXPECT_EQ(found.report.stages[0].seconds, 1.5);
  EXPECT_EQ(found.report.points, 10U);
}

TEST_F(SessionStoreTest, SessionsAreListedByAgeAPageAtATime) {
  Upload("c", 1, 10);
  Upload("a", 1, 20);
  Upload("b", 1, 10);
  Upload("elsewhere", 1, 5, "other");
  auto page = sessions_->List("m", "", 2);
  ASSERT_DONE(page);
  ASSERT_EQ(page->sessions.size(), 2U);
  EXPECT_EQ(page->sessions[0].id, "b");
  EXPECT_EQ(page->sessions[1].id, "c");
  EXPECT_EQ(page->sessions[0].map, "m");
  EXPECT_FALSE(page->next.empty());
  page = sessions_->List("m", page->next, 2);
  ASSERT_EQ(page->sessions.size(), 1U);
  EXPECT_EQ(page->sessions[0].id, "a");
  EXPECT_EQ(page->next, "");
}

TEST_F(SessionStoreTest, AStartingDaemonFindsWhatIsQueuedOrRunningByTheirTurns) {
  Upload("running", 1, 10);
  Upload("queued", 1, 5, "other");
  Upload("uploading", 1, 1);
  Upload("ended", 1, 2);
  ASSERT_DONE(Move("running", SessionState::kUploading, SessionState::kRunning));
  ASSERT_DONE(Move("queued", SessionState::kUploading, SessionState::kQueued, "other"));
  ASSERT_DONE(Move("ended", SessionState::kUploading, SessionState::kRunning));
  ASSERT_DONE(Move("ended", SessionState::kRunning, SessionState::kFailed));
  const auto unfinished = sessions_->Unfinished();
  ASSERT_DONE(unfinished);
  ASSERT_EQ(unfinished->size(), 2U);
  EXPECT_EQ((*unfinished)[0].id, "running");
  EXPECT_EQ((*unfinished)[1].id, "queued");
  EXPECT_EQ((*unfinished)[1].map, "other");
}

TEST_F(SessionStoreTest, PosesAreThoseWrittenLast) {
  Upload("s", 1);
  EXPECT_CODE(sessions_->ReadPoses("m", "s"), kNotFound);
  std::vector<Pose> poses;
  for (uint64_t i = 0; i < 2500; ++i) poses.push_back(AnyScan(i, 1).pose);
  ASSERT_DONE(sessions_->WritePoses("m", "s", poses));
  std::ranges::reverse(poses);
  ASSERT_DONE(sessions_->WritePoses("m", "s", poses));
  const auto read = sessions_->ReadPoses("m", "s");
  ASSERT_DONE(read);
  ASSERT_EQ(read->size(), poses.size());
  for (size_t i = 0; i < poses.size(); ++i) ASSERT_TRUE(SameBits(RowsOf((*read)[i]), RowsOf(poses[i]))) << i;
}

TEST_F(SessionStoreTest, ScansGoWhenTheyAreDeletedAndTheSessionStays) {
  Upload("s", 2);
  EXPECT_CODE(sessions_->DeleteScans("m", "s"), kFailedPrecondition) << "still uploading";
  ASSERT_DONE(Move("s", SessionState::kUploading, SessionState::kRunning));
  ASSERT_DONE(sessions_->DeleteScans("m", "s"));
  ASSERT_DONE(sessions_->DeleteScans("m", "s"));
  EXPECT_CODE(sessions_->ReadScan("m", "s", 0), kNotFound);
  EXPECT_TRUE(sessions_->Find("m", "s")->scans_deleted);
  EXPECT_EQ(sessions_->Find("m", "s")->durable_scans, 2U);
}

TEST_F(SessionStoreTest, ADeletedSessionLeavesNothingForItsNamesake) {
  Upload("s", 2);
  ASSERT_DONE(Move("s", SessionState::kUploading, SessionState::kQueued));
  EXPECT_CODE(sessions_->Delete("m", "s"), kFailedPrecondition);
  ASSERT_DONE(Move("s", SessionState::kQueued, SessionState::kFailed));
  ASSERT_DONE(sessions_->WritePoses("m", "s", std::vector{Pose::Identity()}));
  ASSERT_DONE(sessions_->Delete("m", "s"));
  EXPECT_CODE(sessions_->Find("m", "s"), kNotFound);
  EXPECT_CODE(sessions_->Delete("m", "s"), kNotFound);
  EXPECT_THAT(sessions_->List("m", "", 10)->sessions, IsEmpty());
  const auto again = sessions_->Begin(Session("s", {1}));
  ASSERT_DONE(again);
  EXPECT_EQ(again->durable_scans, 0U);
  EXPECT_CODE(sessions_->ReadPoses("m", "s"), kNotFound);
}

TEST_F(SessionStoreTest, AllSessionsOfAMapGoInAnyState) {
  Upload("a", 1);
  Upload("b", 1);
  Upload("other", 1, 1, "n");
  ASSERT_DONE(Move("a", SessionState::kUploading, SessionState::kRunning));
  ASSERT_DONE(sessions_->DeleteAll("m"));
  EXPECT_THAT(sessions_->List("m", "", 10)->sessions, IsEmpty());
  EXPECT_THAT(*sessions_->Unfinished(), IsEmpty());
  EXPECT_EQ(sessions_->List("n", "", 10)->sessions.size(), 1U);
}

TEST_F(SessionStoreTest, TurnsAreTheOrderInWhichSessionsAreQueued) {
  for (const char* id : {"a", "b", "c"}) Upload(id, 1);
  EXPECT_EQ(*sessions_->FirstUnfinished("m"), std::nullopt);
  for (const char* id : {"c", "a", "b"}) ASSERT_DONE(Move(id, SessionState::kUploading, SessionState::kQueued));
  EXPECT_LT(sessions_->Find("m", "c")->turn, sessions_->Find("m", "a")->turn);
  EXPECT_LT(sessions_->Find("m", "a")->turn, sessions_->Find("m", "b")->turn);
  const auto unfinished = sessions_->Unfinished();
  ASSERT_DONE(unfinished);
  ASSERT_EQ(unfinished->size(), 3U);
  EXPECT_EQ((*unfinished)[0].id, "c");
  EXPECT_EQ((*unfinished)[2].id, "b");

  EXPECT_EQ(*sessions_->FirstUnfinished("m"), "c");
  ASSERT_DONE(Move("a", SessionState::kQueued, SessionState::kRunning));
  EXPECT_EQ(*sessions_->FirstUnfinished("m"), "c");
  ASSERT_DONE(Move("c", SessionState::kQueued, SessionState::kRefused));
  EXPECT_EQ(*sessions_->FirstUnfinished("m"), "a") << "what is at work keeps its turn";
  ASSERT_DONE(sessions_->Requeue("m", "c"));
  ASSERT_DONE(Move("a", SessionState::kRunning, SessionState::kCommitted));
  EXPECT_EQ(*sessions_->FirstUnfinished("m"), "b") << "what is queued again goes last";
  EXPECT_EQ(*sessions_->FirstUnfinished("other map"), std::nullopt);
}

TEST_F(SessionStoreTest, EverySessionHasATurnOfItsOwnWhoeverQueuesThem) {
  constexpr int kSessions = 24, kThreads = 4;
  for (int i = 0; i < kSessions; ++i) Upload(std::to_string(i), 1);
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (int i = t; i < kSessions; i += kThreads) {
        EXPECT_DONE(Move(std::to_string(i), SessionState::kUploading, SessionState::kQueued));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  std::set<uint64_t> turns;
  const auto unfinished = sessions_->Unfinished();
  ASSERT_DONE(unfinished);
  for (const SessionRecord& session : *unfinished) turns.insert(session.turn);
  EXPECT_EQ(turns.size(), static_cast<size_t>(kSessions));
}

TEST_F(SessionStoreTest, RefusedSessionsThatLackMapAreFoundUntilTheyAreTriedAgain) {
  for (const char* id : {"near", "far", "broken"}) {
    Upload(id, 1);
    ASSERT_DONE(Move(id, SessionState::kUploading, SessionState::kRunning));
    SessionRecord record = *sessions_->Find("m", id);
    record.state = SessionState::kRefused;
    record.lacks_map = std::string(id) != "broken";
    ASSERT_DONE(sessions_->Update(record, SessionState::kRunning));
  }
  auto lacking = sessions_->LackingMap("m");
  ASSERT_DONE(lacking);
  ASSERT_EQ(lacking->size(), 2U);
  const uint64_t turn = lacking->front().turn;
  lacking->front().state = SessionState::kQueued;
  ++lacking->front().retries;
  ASSERT_DONE(sessions_->Update(lacking->front(), SessionState::kRefused));
  EXPECT_EQ(sessions_->Find("m", "near")->turn, turn) << "tried again by itself, it keeps its place";
  EXPECT_EQ(sessions_->LackingMap("m")->size(), 1U);
  ASSERT_DONE(sessions_->DeleteScans("m", "far"));
  EXPECT_THAT(*sessions_->LackingMap("m"), IsEmpty());
}

}  // namespace
}  // namespace mapkeep
