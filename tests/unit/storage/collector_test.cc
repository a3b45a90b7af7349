#include "storage/collector.h"

#include <gmock/gmock.h>

#include <random>

#include "storage/leases.h"
#include "storage/session_store.h"
#include "tests/unit/storage/counting_map.h"
#include "tests/unit/storage/test_engine.h"
#include "tests/unit/storage/unanswering_engine.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

constexpr double kLong = 1e6;  ///< beyond every lease

class CollectorTest : public testing::Test {
 protected:
  CollectorTest() { incarnation_ = maps_->Create({.name = "m"})->incarnation; }

  void Commit(int first, int last) {
    for (int session = first; session <= last; ++session) {
      ASSERT_DONE(maps_->Commit("m", CountingRequest(session)));
    }
  }

  GarbageCounts Collect(uint64_t keep) {
    const auto counts = CollectGarbage(*engine_, {.keep_epochs = keep, .now = [this] { return now_; }});
    EXPECT_DONE(counts);
    return counts.value_or(GarbageCounts());
  }

  size_t RowsOf(std::string_view partition, std::string_view prefix = "") {
    size_t count = 0;
    EXPECT_DONE(engine_->Scan(partition, prefix, "", [&](std::string_view key, std::string_view) {
      count += key.starts_with(prefix) ? 1 : 0;
      return true;
    }));
    return count;
  }

  double now_ = 1e9;
  TestEngine engine_;
  MapStoreOptions options_{.now = [this] { return now_; }};
  std::unique_ptr<MapStore> maps_ = OpenMapStore(*engine_, options_);
  uint64_t incarnation_ = 0;
};

TEST_F(CollectorTest, TheNewestEpochsStayAndTheOldestOneIsNamed) {
  Commit(0, 9);
  now_ += kLong;
  const GarbageCounts counts = Collect(4);
  EXPECT_EQ(counts.epochs, 7U);
  EXPECT_GT(counts.values, 0U);
  for (uint64_t epoch = 7; epoch <= 10; ++epoch) EXPECT_DONE(maps_->Open("m", epoch));
  const absl::Status collected = maps_->Open("m", 6).status();
  EXPECT_CODE(collected, kFailedPrecondition);
  EXPECT_THAT(std::string(collected.message()), HasSubstr("oldest one kept is 7"));
  EXPECT_EQ(CheckMap(*engine_, incarnation_), 0U);
  EXPECT_EQ(Collect(4), GarbageCounts()) << "nothing is left to do";
}

TEST_F(CollectorTest, NothingGoesWhileEveryEpochIsKept) {
  Commit(0, 4);
  now_ += kLong;
  EXPECT_EQ(Collect(1000), GarbageCounts());
  EXPECT_EQ(CheckMap(*engine_, incarnation_), 0U);
}

TEST_F(CollectorTest, AnOpenSnapshotReadsOnWhateverIsCollected) {
  Commit(0, 2);
  const auto held = *maps_->Open("m");
  Commit(3, 9);
  Collect(1);
  for (int session = 0; session < 3; ++session) {
    for (const BlockKey key : CountedBlocks(session)) EXPECT_GE(CountIn(*held, key), 1U);
  }
  CheckMap(*engine_, incarnation_);
  EXPECT_CODE(maps_->Open("m", 2), kFailedPrecondition) << "closed before the pin, and to new readers";
}

TEST_F(CollectorTest, APinEndsWithItsStore) {
  Commit(0, 2);
  maps_.reset();
  maps_ = OpenMapStore(*engine_, options_);
  Commit(3, 9);
  maps_.reset();
  Collect(1);
  EXPECT_EQ(CheckMap(*engine_, incarnation_), 0U);
  EXPECT_EQ(RowsOf(HeadPartition(incarnation_), "root/"), 1U);
}

TEST_F(CollectorTest, ASnapshotThatOutsleptItsPinSaysSo) {
  options_.block_cache_bytes = 0;
  options_.pin_seconds = 1e5;  // not renewed while this test runs
  maps_ = OpenMapStore(*engine_, options_);
  Commit(0, 0);
  const auto held = *maps_->Open("m");
  for (int i = 1; i < 4; ++i) {
    // The same blocks again: what `held` reads is superseded.
    CommitRequest request = CountingRequest(0);
    request.session = "again " + std::to_string(i);
    ASSERT_DONE(OpenMapStore(*engine_, options_)->Commit("m", request));
  }
  now_ += kLong;
  Collect(1);
  EXPECT_CODE(held->Read(CountedBlocks(0)[0]), kFailedPrecondition);
  EXPECT_DONE((*maps_->Open("m"))->Read(CountedBlocks(0)[0]));
}

TEST_F(CollectorTest, AnAttemptThatDiedIsCollectedOnceItExpiredAndCannotCommitLater) {
  int operation = -1000;
  UnansweringEngine dying(*engine_, [&operation] {
    // The intent goes through; then nothing is answered, and the last word is still on its way.
    return operation++ < 1 ? Fate::kAnswered : operation == 2 ? Fate::kLate : Fate::kLost;
  });
  {
    const auto maps = OpenMapStore(dying, options_);
    const auto pin = *maps->Open("m");
    operation = 0;
    EXPECT_CODE(maps->Commit("m", CountingRequest(0)), kDeadlineExceeded);
    EXPECT_EQ(Collect(1).attempts, 0U) << "it may still be alive";
    EXPECT_GT(CheckMap(*engine_, incarnation_), 0U);
  }
  now_ += kLong;
  const GarbageCounts counts = Collect(1);
  EXPECT_EQ(counts.attempts, 1U);
  EXPECT_EQ(CheckMap(*engine_, incarnation_), 0U);
  dying.ApplyLate();
  ExpectCounted(*maps_, {});
  Commit(0, 0);
  ExpectCounted(*maps_, {0});
}

TEST_F(CollectorTest, ACommitThatSleptThroughItsCollectionBeginsAgain) {
  int operation = -1000;
  UnansweringEngine slow(*engine_, [&] {
    if (operation++ == 1) {
      // Between the intent and the head's compare-and-set.
      now_ += kLong;
      EXPECT_EQ(Collect(1).attempts, 1U);
    }
    return Fate::kAnswered;
  });
  {
    const auto maps = OpenMapStore(slow, options_);
    const auto pin = *maps->Open("m");
    operation = 0;
    ASSERT_DONE(maps->Commit("m", CountingRequest(0)));
  }
  ExpectCounted(*maps_, {0});
  now_ += kLong;
  Collect(1);
  EXPECT_EQ(CheckMap(*engine_, incarnation_), 0U);
  ExpectCounted(*maps_, {0});
}

TEST_F(CollectorTest, WhatIsDerivedFromATileStaysWithItAndGoesWithIt) {
  const auto commit = [this](const char* session, uint16_t hits) {
    CommitRequest request{.session = session};
    request.blocks = [hits](const Snapshot&) -> absl::StatusOr<std::vector<Block>> {
      return std::vector<Block>{
          {.key = BlockKeyOf(VoxelIndex{1, 2, 0}), .voxels = {{.position = 1, .hits = hits, .is_static = true}}}};
    };
    ASSERT_DONE(maps_->Commit("m", request));
  };
  const auto derived = [](const Snapshot& snapshot, const TileEntry& tile) {
    const auto bytes = snapshot.ReadDerived(tile);
    EXPECT_DONE(bytes);
    return bytes.ok() && *bytes ? **bytes : std::string("nothing");
  };
  commit("a", 8);
  auto before = *maps_->Open("m");
  const TileEntry old_tile = before->TileEntries({})->at(0);
  EXPECT_EQ(derived(*before, old_tile), "nothing");
  ASSERT_DONE(before->StoreDerived(old_tile, "first"));
  ASSERT_DONE(before->StoreDerived(old_tile, "seen from above")) << "the same tile again";
  EXPECT_EQ(derived(*before, old_tile), "seen from above");
  EXPECT_THAT(maps_->Verify("m")->problems, testing::IsEmpty());

  commit("b", 16);
  auto after = *maps_->Open("m");
  const TileEntry new_tile = after->TileEntries({})->at(0);
  EXPECT_EQ(derived(*after, new_tile), "nothing") << "another state of the tile";
  EXPECT_EQ(derived(*before, old_tile), "seen from above") << "while somebody can read the old one";
  ASSERT_DONE(after->StoreDerived(new_tile, "later"));
  before.reset();
  now_ += kLong;
  Collect(1);
  EXPECT_EQ(derived(*after, old_tile), "nothing");
  EXPECT_EQ(derived(*after, new_tile), "later");
  EXPECT_THAT(maps_->Verify("m")->problems, testing::IsEmpty());

  const std::string group = TileGroup(incarnation_, new_tile.key);
  const std::string key = KeyOf(DerivedFrom({ValueKind::kLeaf, static_cast<uint64_t>(new_tile.key), new_tile.version}));
  const std::string value = *engine_->GetValue(group, key);
  ASSERT_DONE(engine_->PutValues(group, std::vector{ImmutableValue{key, "L" + value.substr(1)}}));
  EXPECT_CODE(after->ReadDerived(new_tile).status(), kDataLoss);
  EXPECT_THAT(maps_->Verify("m")->problems, testing::ElementsAre(HasSubstr("was derived")));
  after.reset();
  ASSERT_DONE(maps_->Delete("m"));
  EXPECT_EQ(CheckMap(*engine_, incarnation_), 0U);
}

TEST_F(CollectorTest, ADeletedMapLeavesNothing) {
  Commit(0, 5);
  ASSERT_DONE(OpenLeases(*engine_)->Acquire("m", "s", "a", 10));
  ASSERT_DONE(maps_->Delete("m"));
  EXPECT_EQ(RowsOf(HeadPartition(incarnation_)), 0U);
  EXPECT_EQ(RowsOf(kCatalogue), 0U);
  EXPECT_EQ(CheckMap(*engine_, incarnation_), 0U);
}

TEST_F(CollectorTest, ADeletionWithACommitUnderWayIsFinishedLater) {
  int operation = -1000;
  UnansweringEngine slow(*engine_, [&] {
    if (operation++ == 1) {
      EXPECT_DONE(maps_->Delete("m"));
    }
    return operation == 2 ? Fate::kLost : Fate::kAnswered;
  });
  {
    const auto maps = OpenMapStore(slow, options_);
    const auto pin = *maps->Open("m");
    operation = 0;
    EXPECT_CODE(maps->Commit("m", CountingRequest(0)), kAborted);
  }
  now_ += kLong;
  EXPECT_EQ(Collect(1).maps, 1U);
  EXPECT_EQ(RowsOf(HeadPartition(incarnation_)), 0U);
  EXPECT_EQ(RowsOf(kCatalogue), 0U);
  EXPECT_EQ(CheckMap(*engine_, incarnation_), 0U);
}

TEST_F(CollectorTest, AMapThatWasNeverFinishedBeingMadeGoes) {
  UnansweringEngine dying(*engine_, [] { return Fate::kLost; });
  EXPECT_CODE(OpenMapStore(dying, options_)->Create({.name = "n"}), kDeadlineExceeded);
  EXPECT_EQ(Collect(1).maps, 0U) << "somebody may still be making it";
  now_ += kLong;
  EXPECT_EQ(Collect(1).maps, 1U);
  EXPECT_CODE(maps_->Find("n"), kNotFound);
  EXPECT_EQ(RowsOf(kCatalogue), 1U);
  EXPECT_DONE(maps_->Find("m"));
}

TEST_F(CollectorTest, ItStopsWhenToldTo) {
  EXPECT_CODE(CollectGarbage(*engine_, {}, [](double) { return false; }), kCancelled);
}

TEST_F(CollectorTest, AMapsSessionsAreForgottenWithTheLastOfThem) {
  const auto sessions = OpenSessionStore(*engine_);
  ASSERT_DONE(sessions->Begin({.map = "m", .id = "s", .scan_crc32c = {1}}));
  Collect(1);
  EXPECT_EQ(RowsOf("sessions"), 1U);
  ASSERT_DONE(sessions->Delete("m", "s"));
  Collect(1);
  EXPECT_EQ(RowsOf("sessions"), 0U);
  EXPECT_EQ(RowsOf("sessions/m"), 0U);
}

}  // namespace
}  // namespace mapkeep
