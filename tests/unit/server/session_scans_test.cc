#include "server/pipeline/session_scans.h"

#include <tbb/parallel_for.h>

#include <atomic>

#include "tests/unit/storage/status_matchers.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

constexpr int kScans = 5;
constexpr size_t kPoints = 10000;
constexpr size_t kScanBytes = 16 * kPoints + sizeof(StagedScan);

class SessionScansTest : public testing::Test {
 protected:
  SessionScansTest() {
    for (const char* id : {"a", "b"}) {
      EXPECT_DONE(sessions_->Begin({.map = "m", .id = id, .scan_crc32c = std::vector<uint32_t>(kScans, 1)}));
      std::vector<StagedScan> scans(kScans);
      for (int i = 0; i < kScans; ++i) {
        scans[i].pose.translation().x() = i;
        scans[i].scan.points.resize(kPoints, Eigen::Vector3f::Constant(static_cast<float>(i)));
        scans[i].scan.intensities.resize(kPoints, 0.5F);
      }
      EXPECT_DONE(sessions_->AppendScans("m", id, 0, scans));
      SessionRecord queued = *sessions_->Find("m", id);
      queued.state = SessionState::kQueued;
      EXPECT_DONE(sessions_->Update(queued, SessionState::kUploading));
    }
  }

  static void ReadAll(const SessionScans& scans) {
    for (int i = 0; i < kScans; ++i) {
      const auto scan = scans.Read(i);
      ASSERT_DONE(scan);
      EXPECT_EQ(scan->pose.translation().x(), i);
      EXPECT_EQ(scan->scan.points.size(), kPoints);
      EXPECT_EQ(scan->scan.points.back(), Eigen::Vector3f::Constant(static_cast<float>(i)));
      EXPECT_EQ(scan->scan.intensities.back(), 0.5F);
    }
  }

  /// Which scans are read although the store has them no more.
  static std::vector<int> Kept(const SessionScans& scans) {
    std::vector<int> kept;
    for (int i = 0; i < kScans; ++i) {
      if (scans.Read(i).ok()) kept.push_back(i);
    }
    return kept;
  }

  TestEngine engine_;
  std::unique_ptr<SessionStore> sessions_ = OpenSessionStore(*engine_);
};

TEST_F(SessionScansTest, WhatThereIsMemoryForIsReadFromTheStoreOnce) {
  ScanMemory memory(kScanBytes * 5 / 2);
  {
    const SessionScans scans(*sessions_, "m", "a", kScans, &memory);
    for (int pass = 0; pass < 3; ++pass) ReadAll(scans);
    EXPECT_EQ(memory.used(), 2 * kScanBytes);
    ASSERT_DONE(sessions_->DeleteScans("m", "a"));
    EXPECT_EQ(Kept(scans), (std::vector<int>{0, 1}));
  }
  EXPECT_EQ(memory.used(), 0U);
}

TEST_F(SessionScansTest, SessionsShareTheMemoryAndGiveItBack) {
  ScanMemory memory(kScanBytes * 7);
  auto first = std::make_unique<SessionScans>(*sessions_, "m", "a", kScans, &memory);
  const SessionScans second(*sessions_, "m", "b", kScans, &memory);
  ReadAll(*first);
  ReadAll(second);
  EXPECT_EQ(memory.used(), 7 * kScanBytes);
  first.reset();
  ReadAll(second);
  EXPECT_EQ(memory.used(), 5 * kScanBytes);
  ASSERT_DONE(sessions_->DeleteScans("m", "b"));
  EXPECT_EQ(Kept(second).size(), size_t{kScans});
}

TEST_F(SessionScansTest, WithoutMemoryEveryReadGoesToTheStore) {
  ScanMemory none(0);
  for (ScanMemory* memory : {&none, static_cast<ScanMemory*>(nullptr)}) {
    const SessionScans scans(*sessions_, "m", "a", kScans, memory);
    ReadAll(scans);
  }
  const SessionScans scans(*sessions_, "m", "a", kScans, nullptr);
  ASSERT_DONE(sessions_->DeleteScans("m", "a"));
  EXPECT_TRUE(Kept(scans).empty());
  EXPECT_EQ(none.used(), 0U);
}

TEST_F(SessionScansTest, ThreadsThatReadOneScanAtOnceCountItOnce) {
  ScanMemory memory(kScanBytes * 100);
  const SessionScans scans(*sessions_, "m", "a", kScans, &memory);
  std::atomic<int> failures = 0;
  tbb::parallel_for(0, 40 * kScans, [&](int i) {
    const auto scan = scans.Read(i % kScans);
    if (!scan.ok() || scan->pose.translation().x() != i % kScans) ++failures;
  });
  EXPECT_EQ(failures, 0);
  EXPECT_EQ(memory.used(), kScans * kScanBytes);
}

}  // namespace
}  // namespace mapkeep
