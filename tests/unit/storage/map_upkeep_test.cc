// Checks, trial runs of the collection, copies.

#include <gmock/gmock.h>

#include "storage/collector.h"
#include "storage/map_copy.h"
#include "storage/overlay_engine.h"
#include "storage/session_store.h"
#include "tests/unit/storage/counting_map.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class MapUpkeepTest : public testing::Test {
 protected:
  MapUpkeepTest() { incarnation_ = maps_->Create({.name = "m"})->incarnation; }

  void Commit(int first, int last) {
    for (int session = first; session <= last; ++session) {
      ASSERT_DONE(maps_->Commit("m", CountingRequest(session)));
    }
  }
  std::vector<std::string> ProblemsOf(const std::function<absl::Status(const Block&)>& block = {}) {
    const auto verified = maps_->Verify("m", block);
    EXPECT_DONE(verified);
    return verified.ok() ? verified->problems : std::vector<std::string>();
  }
  /// A value of the map that the head reaches: its group and key.
  std::pair<std::string, std::string> AnyBlock() {
    const BlockKey key = CountedBlocks(0).front();
    const std::string group = TileGroup(incarnation_, TileKeyOf(key));
    std::string last;
    EXPECT_DONE(engine_->ScanValueKeys(group, "ff", "", [&last](std::string_view found) {
      last = found;
      return true;
    }));
    return {group, last};
  }

  TestEngine engine_;
  std::unique_ptr<MapStore> maps_ = OpenMapStore(*engine_, {});
  uint64_t incarnation_ = 0;
};

TEST_F(MapUpkeepTest, AMapThatIsWellIsReadWholeAndHasNoProblems) {
  Commit(0, 9);
  ASSERT_DONE(maps_->Rollback("m", 5));
  const auto verified = maps_->Verify("m");
  ASSERT_DONE(verified);
  EXPECT_THAT(verified->problems, IsEmpty());
  EXPECT_EQ(verified->epochs, 12U);
  EXPECT_GT(verified->blocks, 10U);
  EXPECT_EQ(verified->voxels, verified->blocks) << "each counting block has one voxel";
}

TEST_F(MapUpkeepTest, AMissingADamagedAndALeftValueAreNamed) {
  Commit(0, 4);
  const auto [group, key] = AnyBlock();
  const std::string value = *engine_->GetValue(group, key);
  ASSERT_DONE(engine_->DeleteValues(group, std::vector{key}));
  EXPECT_THAT(ProblemsOf(), testing::Contains(HasSubstr("missing")));
  std::string damaged = value;
  damaged.back() ^= 1;
  ASSERT_DONE(engine_->PutValues(group, std::vector{ImmutableValue{key, damaged}}));
  EXPECT_THAT(ProblemsOf(), testing::Contains(HasSubstr("checksum")));
  ASSERT_DONE(engine_->PutValues(group, std::vector{ImmutableValue{key, value}}));
  EXPECT_THAT(ProblemsOf(), IsEmpty());
  ASSERT_DONE(engine_->PutValues(group, std::vector{ImmutableValue{"ff00", "left"}}));
  EXPECT_THAT(ProblemsOf(), ElementsAre(HasSubstr("left behind")));
}

TEST_F(MapUpkeepTest, WhatABlockMustHoldIsAskedOfEachBlock) {
  Commit(0, 2);
  EXPECT_THAT(ProblemsOf([](const Block&) { return absl::InternalError("not so"); }),
              testing::Each(HasSubstr("not so")));
}

TEST_F(MapUpkeepTest, ATrialOfTheCollectionTellsWhatItWouldDoAndDoesNothing) {
  Commit(0, 19);
  ASSERT_DONE(maps_->AddTag("m", "t", 4));
  maps_.reset();
  const GarbageOptions options{.keep_epochs = 3, .grace_seconds = 0};
  OverlayEngine trial(*engine_);
  const auto would = CollectGarbage(trial, options);
  ASSERT_DONE(would);
  EXPECT_GT(would->values, 0U);
  maps_ = OpenMapStore(*engine_, {});
  EXPECT_DONE(maps_->Open("m", 1));
  EXPECT_THAT(ProblemsOf(), IsEmpty());
  maps_.reset();
  EXPECT_EQ(*CollectGarbage(*engine_, options), *would);
}

TEST_F(MapUpkeepTest, ACopyOfACheckpointHasEveryEpochTagAndSession) {
  SessionStore sessions(*engine_);
  ASSERT_DONE(sessions.Begin({.map = "m", .id = "s", .robot = "r", .scan_crc32c = {1}}));
  const StagedScan scan{.scan = {.points = {Eigen::Vector3f(1, 2, 3)}}};
  ASSERT_DONE(sessions.AppendScans("m", "s", 0, {&scan, 1}));
  Commit(0, 7);
  ASSERT_DONE(maps_->AddTag("m", "t", 2));
  ASSERT_DONE(maps_->Rollback("m", 4));
  const std::string directory = engine_.root() + "/backup";
  ASSERT_DONE(engine_->Checkpoint(directory));
  Commit(20, 22);

  const auto backup = OpenRocksDbEngine(directory);
  ASSERT_DONE(backup);
  EXPECT_THAT(*MapNames(**backup), ElementsAre("m"));
  EXPECT_CODE(CopyMap(**backup, *engine_, "m", "m"), kAlreadyExists);
  EXPECT_CODE(CopyMap(**backup, *engine_, "other", "copy"), kNotFound);
  ASSERT_DONE(CopyMap(**backup, *engine_, "m", "copy"));
  for (uint64_t epoch = 0; epoch <= 9; ++epoch) {
    EXPECT_EQ((*maps_->Open("copy", epoch))->totals(), (*maps_->Open("m", epoch))->totals());
  }
  EXPECT_EQ(maps_->Tags("copy")->size(), 1U);
  EXPECT_THAT(maps_->Verify("copy")->problems, IsEmpty());
  EXPECT_TRUE(maps_->FindCommit("copy", "3")->has_value());
  EXPECT_FALSE(maps_->FindCommit("copy", "5")->has_value());
  EXPECT_EQ(sessions.ReadScan("copy", "s", 0)->scan.points[0].z(), 3);
  ASSERT_DONE(sessions.Delete("copy", "s"));
  EXPECT_DONE(sessions.ReadScan("m", "s", 0)) << "the copy has values of its own";
  CommitRequest request = CountingRequest(5);
  request.base_epoch = 9;
  EXPECT_DONE(maps_->Commit("copy", request)) << "it goes on as any map";
}

TEST_F(MapUpkeepTest, ACopyOfOneEpochIsAMapWhoseHistoryBeginsThere) {
  Commit(0, 7);
  TestEngine other;
  ASSERT_DONE(CopyMap(*engine_, *other, "m", "copy", 5));
  const auto copied = OpenMapStore(*other, {});
  EXPECT_EQ((*copied->Open("copy"))->epoch(), 5U);
  EXPECT_EQ((*copied->Open("copy"))->totals(), (*maps_->Open("m", 5))->totals());
  EXPECT_CODE(copied->Open("copy", 4), kFailedPrecondition);
  EXPECT_TRUE(copied->FindCommit("copy", "4")->has_value());
  EXPECT_FALSE(copied->FindCommit("copy", "5")->has_value());
  EXPECT_THAT(copied->Verify("copy")->problems, IsEmpty());
}

}  // namespace
}  // namespace mapkeep
