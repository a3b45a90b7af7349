// Epochs of the past: rollback, tags, differences and what the collector leaves of them.

#include <gmock/gmock.h>

#include <map>
#include <random>

#include "storage/collector.h"
#include "storage/map_diff.h"
#include "storage/rolled_back_sessions.h"
#include "tests/unit/storage/counting_map.h"
#include "tests/unit/storage/random_blocks.h"
#include "tests/unit/storage/test_engine.h"
#include "tests/unit/storage/unanswering_engine.h"

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kLong = 1e6;  ///< beyond every lease

/// What a snapshot holds, block by block.
using Content = std::map<BlockKey, Block>;

class MapHistoryTest : public testing::Test {
 protected:
  MapHistoryTest() { incarnation_ = maps_->Create({.name = "m"})->incarnation; }

  void Commit(int first, int last) {
    for (int session = first; session <= last; ++session) {
      ASSERT_DONE(maps_->Commit("m", CountingRequest(session)));
    }
  }

  Content ContentOf(std::optional<uint64_t> epoch = {}) {
    Content content;
    const auto snapshot = maps_->Open("m", epoch);
    EXPECT_DONE(snapshot);
    if (!snapshot.ok()) return content;
    const auto tiles = (*snapshot)->Tiles(std::nullopt);
    EXPECT_DONE(tiles);
    for (const TileKey tile : *tiles) {
      const auto keys = (*snapshot)->BlocksOf(tile);
      EXPECT_DONE(keys);
      for (const BlockKey key : *keys) {
        const auto block = (*snapshot)->Read(key);
        EXPECT_DONE(block);
        if (block.ok()) content.emplace(key, **block);
      }
    }
    return content;
  }

  bool IsApplied(int session) {
    const auto commit = maps_->FindCommit("m", std::to_string(session));
    EXPECT_DONE(commit);
    return commit.ok() && commit->has_value();
  }

  void Collect(uint64_t keep, double keep_seconds = 0) {
    EXPECT_DONE(
        CollectGarbage(*engine_, {.keep_epochs = keep, .keep_seconds = keep_seconds, .now = [this] { return now_; }}));
  }

  /// Makes this process forget what it reads, as a restart would.
  void Reopen() {
    maps_.reset();
    maps_ = OpenMapStore(*engine_, options_);
  }

  double now_ = 1e9;
  TestEngine engine_;
  MapStoreOptions options_{.now = [this] { return now_; }};
  std::unique_ptr<MapStore> maps_ = OpenMapStore(*engine_, options_);
  uint64_t incarnation_ = 0;
};

TEST_F(MapHistoryTest, ARollbackIsANewEpochWithTheOldContentAndLosesNothing) {
  Commit(0, 2);
  const Content old = ContentOf();
  Commit(3, 5);
  const Content before = ContentOf();
  const auto rolled = maps_->Rollback("m", 3);
  ASSERT_DONE(rolled);
  EXPECT_EQ(rolled->commit.epoch, 7U);
  EXPECT_EQ(rolled->commit.base_epoch, 3U);
  EXPECT_TRUE(rolled->commit.rollback);
  EXPECT_THAT(rolled->withdrawn, ElementsAre("3", "4", "5"));
  EXPECT_EQ(ContentOf(), old);
  EXPECT_EQ(ContentOf(6), before);
  EXPECT_EQ((*maps_->Open("m"))->sessions(), 3U);
}

TEST_F(MapHistoryTest, ASessionThatWasRolledBackCanBeCommittedAgainOnce) {
  Commit(0, 3);
  ASSERT_DONE(maps_->Rollback("m", 2));
  EXPECT_TRUE(IsApplied(1));
  EXPECT_FALSE(IsApplied(2));
  CommitRequest again = CountingRequest(2);
  again.base_epoch = 5;
  EXPECT_EQ(maps_->Commit("m", again)->epoch, 6U);
  EXPECT_EQ(maps_->Commit("m", again)->epoch, 6U) << "exactly once";
  EXPECT_EQ((*maps_->Open("m"))->sessions(), 3U);
}

TEST_F(MapHistoryTest, ARollbackOfARollbackBringsTheSessionsBack) {
  Commit(0, 3);
  const Content before = ContentOf();
  ASSERT_DONE(maps_->Rollback("m", 1));
  const auto back = maps_->Rollback("m", 4);
  ASSERT_DONE(back);
  EXPECT_THAT(back->revived, ElementsAre("1", "2", "3"));
  EXPECT_THAT(back->withdrawn, IsEmpty());
  EXPECT_EQ(ContentOf(), before);
  for (int session = 0; session < 4; ++session) EXPECT_TRUE(IsApplied(session));
  EXPECT_EQ(maps_->FindCommit("m", "2")->value().epoch, 3U);
}

TEST_F(MapHistoryTest, AJobWhoseBaseWasRolledBackStartsOver) {
  Commit(0, 3);
  ASSERT_DONE(maps_->Rollback("m", 2));  // epoch 5
  CommitRequest request = CountingRequest(9);
  for (const uint64_t gone : {3, 4}) {
    request.base_epoch = gone;
    const absl::Status refused = maps_->Commit("m", request).status();
    EXPECT_CODE(refused, kAborted);
    EXPECT_THAT(std::string(refused.message()), HasSubstr("rolled back"));
  }
  request.base_epoch = 2;
  EXPECT_EQ(maps_->Commit("m", request)->epoch, 6U) << "what the rollback kept is still a base";
  ASSERT_DONE(maps_->Rollback("m", 4));  // epoch 7: the other branch again
  request = CountingRequest(10);
  request.base_epoch = 6;
  EXPECT_CODE(maps_->Commit("m", request), kAborted);
  request.base_epoch = 3;
  EXPECT_DONE(maps_->Commit("m", request));
}

TEST_F(MapHistoryTest, ARollbackWhoseAnswerIsLostHappensOnce) {
  for (const Fate fate : {Fate::kApplied, Fate::kLost, Fate::kLate}) {
    TestEngine real;
    int calls = 0;
    bool rolling = false;
    UnansweringEngine engine(*real, [&] { return rolling && calls++ == 0 ? fate : Fate::kAnswered; });
    const auto maps = OpenMapStore(engine, {});
    ASSERT_DONE(maps->Create({.name = "m"}));
    for (int session = 0; session < 3; ++session) ASSERT_DONE(maps->Commit("m", CountingRequest(session)));
    const auto held = maps->Open("m", 1);  // the pin is there already, so that the first swap is the head's
    rolling = true;
    const auto rolled = maps->Rollback("m", 1);
    ASSERT_DONE(rolled);
    EXPECT_EQ(rolled->commit.epoch, 4U);
    engine.ApplyLate();
    EXPECT_EQ((*maps->Open("m"))->epoch(), 4U);
    EXPECT_THAT(rolled->withdrawn, ElementsAre("1", "2"));
  }
}

TEST_F(MapHistoryTest, VersionsTellWhatMadeEachEpochAndWhetherItCanBeRead) {
  Commit(0, 3);
  ASSERT_DONE(maps_->AddTag("m", "first", 1));
  ASSERT_DONE(maps_->Rollback("m", 2));
  now_ += kLong;
  Reopen();
  Collect(2);
  const auto versions = maps_->Versions("m", std::nullopt, 100);
  ASSERT_DONE(versions);
  ASSERT_EQ(versions->size(), 6U);
  EXPECT_TRUE((*versions)[0].commit.rollback);
  EXPECT_EQ((*versions)[0].commit.base_epoch, 2U);
  EXPECT_EQ((*versions)[0].sessions, 2U);
  EXPECT_EQ((*versions)[1].commit.session, "3");
  std::vector<bool> readable;
  for (const MapVersion& version : *versions) readable.push_back(version.readable);
  EXPECT_THAT(readable, ElementsAre(true, true, false, false, true, false));
  EXPECT_THAT((*versions)[4].tags, ElementsAre("first"));
  EXPECT_EQ(maps_->Versions("m", 3, 2)->front().commit.epoch, 3U);
  EXPECT_EQ(maps_->Versions("m", 3, 2)->size(), 2U);
}

TEST_F(MapHistoryTest, ATaggedEpochReadsOnAndCanBeRolledBackToWhateverIsCollected) {
  Commit(0, 2);
  const Content tagged = ContentOf();
  ASSERT_DONE(maps_->AddTag("m", "survey", std::nullopt));
  Commit(3, 12);
  Reopen();
  now_ += kLong;
  Collect(1);
  EXPECT_CODE(maps_->Open("m", 2), kFailedPrecondition);
  EXPECT_CODE(maps_->Open("m", 4), kFailedPrecondition);
  EXPECT_EQ(ContentOf(3), tagged);
  EXPECT_EQ(CheckMap(*engine_, incarnation_), 0U);
  ASSERT_DONE(maps_->Rollback("m", 3));
  EXPECT_EQ(ContentOf(), tagged);
  Commit(20, 25);
  Reopen();
  now_ += kLong;
  Collect(1);
  EXPECT_EQ(ContentOf(3), tagged);
  ASSERT_DONE(maps_->RemoveTag("m", "survey"));
  Reopen();
  now_ += kLong;
  Collect(1);
  EXPECT_CODE(maps_->Open("m", 3), kFailedPrecondition);
  EXPECT_EQ(CheckMap(*engine_, incarnation_), 0U);
}

TEST_F(MapHistoryTest, ATagNamesOneEpochThatCanBeRead) {
  Commit(0, 4);
  EXPECT_CODE(maps_->AddTag("m", "t", 9), kNotFound);
  EXPECT_EQ(maps_->AddTag("m", "t", std::nullopt)->epoch, 5U);
  EXPECT_DONE(maps_->AddTag("m", "t", 5)) << "the same again";
  EXPECT_CODE(maps_->AddTag("m", "t", 4), kAlreadyExists);
  EXPECT_CODE(maps_->RemoveTag("m", "u"), kNotFound);
  Collect(1);
  EXPECT_CODE(maps_->AddTag("m", "old", 2), kFailedPrecondition);
  EXPECT_DONE(maps_->AddTag("m", "same", 5));
  EXPECT_EQ(maps_->Tags("m")->size(), 2U);
}

TEST_F(MapHistoryTest, EpochsStayForTheirAgeAsWellAsForTheirNumber) {
  for (int session = 0; session < 10; ++session) {
    Commit(session, session);
    now_ += 60;
  }
  // Epoch e was replaced 60 (10 - e) seconds ago.
  Reopen();
  Collect(2, 200);
  EXPECT_CODE(maps_->Open("m", 6), kFailedPrecondition);
  EXPECT_DONE(maps_->Open("m", 7));
  Reopen();
  Collect(5, 0);
  EXPECT_DONE(maps_->Open("m", 7)) << "what is open already is not closed by a larger number";
  Collect(2, 0);
  EXPECT_CODE(maps_->Open("m", 8), kFailedPrecondition);
}

TEST_F(MapHistoryTest, WhateverIsDoneInWhateverOrderEveryReadableEpochReadsAsItWasMade) {
  std::mt19937_64 random(7);
  std::map<uint64_t, Content> made = {{0, {}}};
  std::map<std::string, uint64_t> tags;
  int session = 0;
  const int steps = std::getenv("MAPKEEP_LONG") != nullptr ? 2000 : 150;
  uint64_t head = 0;
  const auto forget_unreadable = [&] {
    const auto versions = maps_->Versions("m", std::nullopt, 10000);
    ASSERT_DONE(versions);
    for (const MapVersion& version : *versions) {
      if (!version.readable) made.erase(version.commit.epoch);
    }
  };
  for (int step = 0; step < steps; ++step) {
    const uint64_t choice = random() % 10;
    if (choice < 5) {
      CommitRequest request = CountingRequest(session++);
      request.base_epoch = head;
      ASSERT_DONE(maps_->Commit("m", request));
      made[++head] = ContentOf();
    } else if (choice == 5) {
      const auto chosen = std::next(made.begin(), static_cast<int>(random() % made.size()));
      ASSERT_DONE(maps_->Rollback("m", chosen->first));
      EXPECT_EQ(ContentOf(), chosen->second);
      made[++head] = chosen->second;
    } else if (choice == 6) {
      const auto chosen = std::next(made.begin(), static_cast<int>(random() % made.size()));
      const std::string name = "t" + std::to_string(step);
      ASSERT_DONE(maps_->AddTag("m", name, chosen->first));
      tags[name] = chosen->first;
    } else if (choice == 7 && !tags.empty()) {
      ASSERT_DONE(maps_->RemoveTag("m", tags.begin()->first));
      tags.erase(tags.begin());
      forget_unreadable();
    } else if (choice >= 8) {
      Reopen();
      now_ += kLong;
      Collect(1 + random() % 4);
      forget_unreadable();
      for (const auto& [name, epoch] : tags) ASSERT_TRUE(made.contains(epoch)) << name;
      for (const auto& [epoch, content] : made) ASSERT_EQ(ContentOf(epoch), content) << "epoch " << epoch;
      Reopen();
      ASSERT_EQ(CheckMap(*engine_, incarnation_), 0U) << "step " << step;
    }
  }
}

TEST_F(MapHistoryTest, ADifferenceHasWhatBecameStaticAndWhatCeasedToBe) {
  const auto voxel = [](uint16_t position, bool is_static) {
    return Voxel{.position = position, .hits = 8, .is_static = is_static};
  };
  const auto commit = [&](const std::string& name, std::vector<Block> blocks) {
    ASSERT_DONE(maps_->Commit("m", {.session = name, .blocks = [blocks](const Snapshot&) { return blocks; }}));
  };
  const BlockKey a = BlockKeyOf(VoxelIndex{0, 0, 0}), b = BlockKeyOf(VoxelIndex{40, 0, 0});
  commit("1", {{a, {voxel(1, true), voxel(2, true), voxel(3, false)}}, {b, {voxel(1, true)}}});
  commit("2", {{a, {voxel(1, true), voxel(3, true), voxel(4, false)}}});
  std::vector<BlockChange> changes;
  const auto first = *maps_->Open("m", 1), second = *maps_->Open("m", 2), empty = *maps_->Open("m", 0);
  const auto note = [&changes](const BlockChange& change) {
    changes.push_back(change);
    return absl::OkStatus();
  };
  ASSERT_DONE(CompareSnapshots(*first, *second, note));
  ASSERT_EQ(changes.size(), 1U) << "the other block is shared";
  EXPECT_EQ(changes[0].appeared, (Block{a, {voxel(3, true)}}));
  EXPECT_EQ(changes[0].disappeared, (Block{a, {voxel(2, true)}}));
  const auto objects = ChangedObjectsBetween(*first, *second, changes);
  ASSERT_DONE(objects);
  EXPECT_TRUE(objects->empty()) << "two voxels are no object";
  changes.clear();
  ASSERT_DONE(CompareSnapshots(*empty, *first, note));
  EXPECT_EQ(changes.size(), 2U);
  ASSERT_DONE(maps_->Create({.name = "other"}));
  EXPECT_CODE(CompareSnapshots(**maps_->Open("other"), *first, note), kInvalidArgument);
}

class RolledBackSessionsTest : public MapHistoryTest {
 protected:
  /// As the pipeline does: stages, commits, drops the scans unless they are kept.
  void RunSession(int number, bool keep_scans) {
    const std::string id = std::to_string(number);
    ASSERT_DONE(sessions_.Begin({.map = "m", .id = id, .keep_scans = keep_scans, .scan_crc32c = {1}}));
    const StagedScan scan{.scan = {.points = {Eigen::Vector3f(1, 2, 3)}}};
    ASSERT_DONE(sessions_.AppendScans("m", id, 0, {&scan, 1}));
    SessionRecord record = *sessions_.Find("m", id);
    record.state = SessionState::kRunning;
    ASSERT_DONE(sessions_.Update(record, SessionState::kUploading));
    const auto commit = maps_->Commit("m", CountingRequest(number));
    ASSERT_DONE(commit);
    if (!keep_scans) {
      ASSERT_DONE(sessions_.DeleteScans("m", id));
    }
    record.state = SessionState::kCommitted;
    record.report.epoch = commit->epoch;
    ASSERT_DONE(sessions_.Update(record, SessionState::kRunning));
  }
  SessionState StateOf(int number) { return sessions_.Find("m", std::to_string(number))->state; }

  SessionStore sessions_{*engine_};
};

TEST_F(RolledBackSessionsTest, TheirRecordsSaySoAndSayOtherwiseWhenTheyAreBack) {
  for (int session = 0; session < 3; ++session) RunSession(session, true);
  ASSERT_DONE(maps_->Rollback("m", 1));
  EXPECT_EQ(*SettleSessions(*engine_, sessions_, "m"), 2U);
  EXPECT_EQ(StateOf(0), SessionState::kCommitted);
  EXPECT_EQ(StateOf(1), SessionState::kRolledBack);
  EXPECT_EQ(StateOf(2), SessionState::kRolledBack);
  EXPECT_EQ(*SettleSessions(*engine_, sessions_, "m"), 0U);
  ASSERT_DONE(maps_->Rollback("m", 2));
  EXPECT_EQ(*SettleSessions(*engine_, sessions_, "m"), 1U);
  EXPECT_EQ(StateOf(1), SessionState::kCommitted);
  EXPECT_EQ(StateOf(2), SessionState::kRolledBack);
}

TEST_F(RolledBackSessionsTest, OneWithItsScansIsQueuedAgain) {
  for (int session = 0; session < 2; ++session) RunSession(session, true);
  EXPECT_CODE(sessions_.Requeue("m", "1"), kFailedPrecondition) << "committed";
  ASSERT_DONE(maps_->Rollback("m", 1));
  ASSERT_DONE(SettleSessions(*engine_, sessions_, "m"));
  const auto queued = sessions_.Requeue("m", "1");
  ASSERT_DONE(queued);
  EXPECT_EQ(queued->state, SessionState::kQueued);
  EXPECT_EQ(queued->reason, "");
  EXPECT_EQ(sessions_.Unfinished()->size(), 1U);
  EXPECT_DONE(sessions_.ReadScan("m", "1", 0));
}

TEST_F(RolledBackSessionsTest, OneWithoutItsScansIsUploadedAgainUnderItsId) {
  for (int session = 0; session < 2; ++session) RunSession(session, false);
  ASSERT_DONE(maps_->Rollback("m", 1));
  ASSERT_DONE(SettleSessions(*engine_, sessions_, "m"));
  EXPECT_CODE(sessions_.Requeue("m", "1"), kFailedPrecondition);
  EXPECT_CODE(sessions_.Begin({.map = "m", .id = "1", .scan_crc32c = {2}}), kAlreadyExists);
  const auto begun = sessions_.Begin({.map = "m", .id = "1", .scan_crc32c = {1}});
  ASSERT_DONE(begun);
  EXPECT_EQ(begun->state, SessionState::kUploading);
  EXPECT_EQ(begun->durable_scans, 0U);
  const StagedScan scan{.scan = {.points = {Eigen::Vector3f(1, 2, 3)}}};
  EXPECT_DONE(sessions_.AppendScans("m", "1", 0, {&scan, 1}));
  EXPECT_DONE(sessions_.ReadScan("m", "1", 0));
}

TEST_F(MapHistoryTest, ATilesVersionChangesWithItsContentAndComesBackWithIt) {
  // CountingRequest changes every block; this one only some.
  std::mt19937_64 random(3);
  const auto commit = [&](const std::string& session, std::vector<VoxelIndex> where) {
    std::vector<Block> blocks;
    for (const VoxelIndex& index : where) {
      blocks.push_back(RandomBlock(BlockKeyOf(index), 20, random));
      blocks.back().voxels[0].is_static = true;
    }
    CommitRequest request{.session = session, .blocks = [blocks](const Snapshot&) { return blocks; }};
    ASSERT_DONE(maps_->Commit("m", request));
  };
  const auto versions = [&](std::optional<uint64_t> epoch = {}) {
    std::map<TileKey, WriteId> found;
    const auto snapshot = maps_->Open("m", epoch);
    EXPECT_DONE(snapshot);
    const auto entries = (*snapshot)->TileEntries(std::nullopt);
    EXPECT_DONE(entries);
    for (const TileEntry& entry : *entries) {
      found[entry.key] = entry.version;
      EXPECT_EQ((*(*snapshot)->FindTile(entry.key))->version, entry.version);
    }
    return found;
  };
  const TileKey near = TileKeyOf(VoxelIndex{0, 0, 0}), far = TileKeyOf(VoxelIndex{-3, 2, 0});
  commit("1", {{0, 0, 0}, {3, 3, -5}, {-12, 8, 0}});
  const auto first = versions();
  EXPECT_EQ(first.size(), 2U);
  commit("2", {{1, 2, 9}});
  EXPECT_NE(versions()[near], first.at(near));
  EXPECT_EQ(versions()[far], first.at(far));
  EXPECT_EQ(versions(1), first);
  ASSERT_DONE(maps_->Rollback("m", 1));
  EXPECT_EQ(versions(), first);
  EXPECT_FALSE(maps_->Open("m").value()->FindTile(TileKeyOf(VoxelIndex{5, 5, 0}))->has_value());

  const auto head = maps_->Head("m");
  ASSERT_DONE(head);
  EXPECT_EQ(*head, (MapHead{incarnation_, 3}));
  const auto commits = maps_->CommitsAfter("m", {incarnation_, 1}, 10);
  ASSERT_DONE(commits);
  ASSERT_EQ(commits->size(), 2U);
  EXPECT_THAT((*commits)[0].touched_tiles, ElementsAre(near));
  EXPECT_TRUE((*commits)[1].rollback);
  EXPECT_EQ(maps_->CommitsAfter("m", {incarnation_, 1}, 1)->size(), 1U);
  EXPECT_CODE(maps_->CommitsAfter("m", {incarnation_ + 1, 1}, 1), kNotFound);
  EXPECT_CODE(maps_->Head("none"), kNotFound);
}

}  // namespace
}  // namespace mapkeep
