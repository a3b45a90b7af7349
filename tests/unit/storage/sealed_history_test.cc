#include "storage/sealed_history.h"

#include <gmock/gmock.h>

#include "storage/collector.h"
#include "storage/map_copy.h"
#include "storage/map_history.h"
#include "tests/unit/storage/counting_map.h"
#include "tests/unit/storage/test_engine.h"
#include "tests/unit/storage/unsynced_env.h"

namespace mapkeep {
namespace {

using ::testing::IsEmpty;

constexpr int kCommits = kSegmentEpochs + 60;

class SealedHistoryTest : public testing::Test {
 protected:
  SealedHistoryTest() {
    incarnation_ = maps_->Create({.name = "m"})->incarnation;
    for (int session = 0; session < kCommits; ++session) EXPECT_DONE(maps_->Commit("m", CountingRequest(session)));
    EXPECT_DONE(maps_->AddTag("m", "old", 500));
  }

  size_t CommitRows() {
    size_t count = 0;
    EXPECT_DONE(engine_->Scan(HeadPartition(incarnation_), "commit/", "commit0",
                              [&count](std::string_view, std::string_view) { return ++count > 0; }));
    return count;
  }

  /// Every record, encoded.
  std::vector<std::string> Records(const std::string& map, const MapStore& maps) {
    const auto versions = maps.Versions(map, {}, 10 * kCommits);
    EXPECT_DONE(versions);
    std::vector<std::string> records;
    for (const MapVersion& version : *versions) records.push_back(EncodeRow(version.commit));
    return records;
  }

  UnsyncedEnv env_;
  TestEngine engine_{
      {"RocksDb", [this](const std::string& directory) { return OpenRocksDbEngine(directory, {.env = &env_}); }}};
  std::unique_ptr<MapStore> maps_ = OpenMapStore(*engine_, {});
  uint64_t incarnation_ = 0;
};

TEST_F(SealedHistoryTest, OldRecordsMoveIntoSegmentsAndAreReadAsBefore) {
  const std::vector<std::string> before = Records("m", *maps_);
  ASSERT_DONE(SealHistory(*engine_, incarnation_));
  EXPECT_EQ(CommitRows(), static_cast<size_t>(kCommits)) << "the newest thousand stay rows";
  ASSERT_DONE(SealHistory(*engine_, incarnation_, 50));
  EXPECT_EQ(CommitRows(), kCommits - kSegmentEpochs);
  EXPECT_EQ(*SealedEpochs(*engine_, incarnation_), kSegmentEpochs);
  ASSERT_DONE(SealHistory(*engine_, incarnation_, 50)) << "nothing is left to do";
  EXPECT_EQ(Records("m", *maps_), before);
  std::vector<std::string> visited;
  ASSERT_DONE(ForEachCommit(*engine_, incarnation_, [&visited](const CommitRecord& commit) {
    visited.push_back(EncodeRow(commit));
    return absl::OkStatus();
  }));
  std::ranges::reverse(visited);
  EXPECT_TRUE(std::equal(visited.begin(), visited.end(), before.begin())) << "all but epoch 0";

  EXPECT_EQ(maps_->FindCommit("m", "3")->value().epoch, 4U);
  EXPECT_EQ(maps_->Commit("m", CountingRequest(3))->epoch, 4U) << "found, and not merged again";
  EXPECT_THAT(maps_->Verify("m")->problems, IsEmpty());
  const auto rolled = maps_->Rollback("m", 500);
  ASSERT_DONE(rolled);
  EXPECT_EQ(rolled->withdrawn.size(), kCommits - 500U);
}

TEST_F(SealedHistoryTest, CopiesHaveTheWholeHistory) {
  ASSERT_DONE(SealHistory(*engine_, incarnation_, 50));
  const std::vector<std::string> before = Records("m", *maps_);
  ASSERT_DONE(CopyMap(*engine_, *engine_, "m", "all"));
  EXPECT_EQ(Records("all", *maps_), before);
  EXPECT_EQ(*SealedEpochs(*engine_, maps_->Find("all")->incarnation), kSegmentEpochs);
  for (const uint64_t epoch : {uint64_t{500}, kSegmentEpochs + 20}) {
    const std::string copy = "epoch-" + std::to_string(epoch);
    ASSERT_DONE(CopyMap(*engine_, *engine_, "m", copy, epoch));
    const std::vector<std::string> records = Records(copy, *maps_);
    ASSERT_EQ(records.size(), epoch + 1);
    EXPECT_TRUE(std::equal(records.begin(), records.end() - 1, before.begin() + (before.size() - records.size())));
    EXPECT_THAT(maps_->Verify(copy)->problems, IsEmpty());
  }
}

TEST_F(SealedHistoryTest, ADamagedOrMissingSegmentIsDataLoss) {
  ASSERT_DONE(SealHistory(*engine_, incarnation_, 50));
  const std::string group = HistoryGroup(incarnation_), key = SegmentKey(1);
  std::string value = *engine_->GetValue(group, key);
  value.back() ^= 1;
  ASSERT_DONE(engine_->PutValues(group, std::vector{ImmutableValue{key, value}}));
  EXPECT_CODE(ReadCommit(*engine_, incarnation_, 7), kDataLoss);
  EXPECT_DONE(ReadCommit(*engine_, incarnation_, kSegmentEpochs + 1));
  ASSERT_DONE(engine_->DeleteValues(group, std::vector{key}));
  EXPECT_CODE(ReadCommit(*engine_, incarnation_, 7), kDataLoss);
}

TEST_F(SealedHistoryTest, ADeletedMapLeavesNoSegment) {
  ASSERT_DONE(SealHistory(*engine_, incarnation_, 50));
  ASSERT_DONE(maps_->Delete("m"));
  EXPECT_DONE(engine_->ScanValueKeys(HistoryGroup(incarnation_), "", "", [](std::string_view) {
    ADD_FAILURE() << "left behind";
    return true;
  }));
}

}  // namespace
}  // namespace mapkeep
