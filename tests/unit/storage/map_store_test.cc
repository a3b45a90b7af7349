#include "storage/map_store.h"

#include <gmock/gmock.h>

#include <map>

#include "storage/leases.h"
#include "storage/map_values.h"
#include "tests/unit/storage/random_blocks.h"
#include "tests/unit/storage/status_matchers.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<std::string> NamesOf(const std::vector<MapRecord>& maps) {
  std::vector<std::string> names;
  for (const MapRecord& map : maps) names.push_back(map.name);
  return names;
}

class MapStoreTest : public testing::Test {
 protected:
  MapStoreTest() { EXPECT_DONE(maps_->Create({.name = "m"})); }

  CommitRequest Request(const std::string& session, std::vector<Block> blocks) {
    return {.session = session, .blocks = [this, blocks = std::move(blocks)](const Snapshot&) {
              ++calls_;
              return blocks;
            }};
  }
  absl::StatusOr<CommitRecord> Commit(const std::string& session, std::vector<Block> blocks) {
    return maps_->Commit("m", Request(session, std::move(blocks)));
  }
  Block Any(const VoxelIndex& index, size_t voxels = 50) { return RandomBlock(BlockKeyOf(index), voxels, random_); }

  std::mt19937_64 random_{1};
  int calls_ = 0;
  TestEngine engine_;
  std::unique_ptr<MapStore> maps_ = OpenMapStore(*engine_, {});
};

TEST_F(MapStoreTest, AMapIsFoundUnderItsNameUntilItIsDeleted) {
  const auto made =
      maps_->Create({.name = "site", .voxel_size = 0.1, .origin = Eigen::Vector3d(1, 2, 3), .crs = "EPSG:1"});
  ASSERT_DONE(made);
  EXPECT_NE(made->incarnation, 0U);
  EXPECT_CODE(maps_->Create({.name = "site"}), kAlreadyExists);
  const auto found = maps_->Find("site");
  ASSERT_DONE(found);
  EXPECT_EQ(found->incarnation, made->incarnation);
  EXPECT_EQ(found->voxel_size, 0.1);
  EXPECT_EQ(found->origin, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(found->crs, "EPSG:1");
  EXPECT_DONE(maps_->Delete("site"));
  EXPECT_CODE(maps_->Find("site"), kNotFound);
  EXPECT_CODE(maps_->Delete("site"), kNotFound);
  EXPECT_CODE(maps_->Open("site"), kNotFound);
  const auto again = maps_->Create({.name = "site"});
  ASSERT_DONE(again);
  EXPECT_NE(again->incarnation, made->incarnation);
}

TEST_F(MapStoreTest, MapsAreListedByNameAPageAtATime) {
  for (const char* name : {"b", "a", "b.1"}) EXPECT_DONE(maps_->Create({.name = name}));
  EXPECT_THAT(NamesOf(*maps_->List("", 2)), ElementsAre("a", "b"));
  EXPECT_THAT(NamesOf(*maps_->List("b", 10)), ElementsAre("b.1", "m"));
  EXPECT_THAT(NamesOf(*maps_->List("m", 10)), IsEmpty());
}

TEST_F(MapStoreTest, AnEmptyMapIsEpochZero) {
  const auto snapshot = maps_->Open("m");
  ASSERT_DONE(snapshot);
  EXPECT_EQ((*snapshot)->epoch(), 0U);
  EXPECT_EQ((*snapshot)->totals(), MapTotals());
  EXPECT_EQ((*snapshot)->bounds(), std::nullopt);
  EXPECT_THAT(*(*snapshot)->Tiles(std::nullopt), IsEmpty());
  EXPECT_EQ(*(*snapshot)->Read(BlockKeyOf(VoxelIndex{0, 0, 0})), nullptr);
}

TEST_F(MapStoreTest, WhatIsCommittedIsReadWithItsTotalsAndBounds) {
  const Block low = Any({0, 0, 0}, 30), high = Any({0, 1, 9}, 40), far = Any({-9, 5, -2}, 50);
  const auto record = Commit("s", {high, far, low});
  ASSERT_DONE(record);
  EXPECT_EQ(record->epoch, 1U);
  EXPECT_THAT(record->touched_tiles, ElementsAre(TileKeyOf(far.key), TileKeyOf(low.key)));
  const auto snapshot = *maps_->Open("m");
  EXPECT_EQ(snapshot->epoch(), 1U);
  EXPECT_EQ(snapshot->sessions(), 1U);
  EXPECT_EQ(snapshot->totals().voxels, 120U);
  EXPECT_EQ(snapshot->totals().blocks, 3U);
  EXPECT_EQ(snapshot->totals().tiles, 2U);
  EXPECT_EQ(snapshot->bounds()->first, (VoxelIndex{-12, 0, -2}));
  EXPECT_EQ(snapshot->bounds()->last, (VoxelIndex{3, 7, 9}));
  for (const Block& block : {low, high, far}) EXPECT_EQ(**snapshot->Read(block.key), block);
  EXPECT_THAT(*snapshot->BlocksOf(TileKeyOf(low.key)), ElementsAre(low.key, high.key));
  EXPECT_THAT(*snapshot->BlocksOf(TileKey{1}), IsEmpty());
}

TEST_F(MapStoreTest, ATileIsReadWholeFromTheCacheOrTheEngineAndNoBlockOfItIsMissedSilently) {
  const Block low = Any({0, 0, 0}, 30), middle = Any({3, 1, 2}, 700), high = Any({0, 1, 9}, 40);
  ASSERT_DONE(Commit("s1", {low, middle}));
  ASSERT_DONE(Commit("s2", {high, Any({4, 0, 0})}));
  const TileKey tile = TileKeyOf(low.key);
  const auto without_cache = OpenMapStore(*engine_, {.block_cache_bytes = 0});
  for (MapStore* store : {maps_.get(), without_cache.get()}) {
    const auto snapshot = *store->Open("m");
    ASSERT_DONE(snapshot->Read(low.key)) << "so that some are cached and some are not";
    const auto blocks = snapshot->ReadTile(tile);
    ASSERT_DONE(blocks);
    std::vector<Block> read;
    for (const auto& block : *blocks) read.push_back(*block);
    std::vector<Block> expected = {low, middle, high};
    std::ranges::sort(expected, {}, &Block::key);
    EXPECT_EQ(read, expected);
    EXPECT_THAT(*snapshot->ReadTile(TileKey{1}), IsEmpty());
  }
  const auto held = *without_cache->Open("m");
  const auto entries = *held->BlockEntries(tile);
  const ValueName lost{ValueKind::kBlock, static_cast<uint64_t>(entries[1].key), entries[1].version};
  ASSERT_DONE(DeleteNamed(*engine_, held->map().incarnation, {&lost, 1}));
  EXPECT_CODE(held->ReadTile(tile), kDataLoss);
  EXPECT_DONE(held->ReadTile(TileKeyOf(BlockKeyOf(VoxelIndex{4, 0, 0})))) << "others are read";
}

TEST_F(MapStoreTest, TilesOfARangeAreThoseWithABlockInItsColumns) {
  const Block near = Any({0, 0, 0}), far = Any({3, 3, 0});
  ASSERT_DONE(Commit("s", {near, far, Any({8, 0, 5})}));
  const auto snapshot = *maps_->Open("m");
  const auto tiles = [&](VoxelIndex first, VoxelIndex last) { return *snapshot->Tiles(BlockRange{first, last}); };
  EXPECT_THAT(tiles({0, 0, 7}, {0, 0, 8}), ElementsAre(TileKeyOf(near.key))) << "columns know no z";
  EXPECT_THAT(tiles({1, 1, 0}, {2, 2, 0}), IsEmpty()) << "inside the tile, beside its blocks";
  EXPECT_EQ(tiles({3, 0, 0}, {8, 3, 0}).size(), 2U);
}

TEST_F(MapStoreTest, AnEmptyBlockDeletesAndTheLastOneLeavesAnEmptyMap) {
  const Block a = Any({0, 0, 0}), b = Any({100, 0, 0});
  ASSERT_DONE(Commit("s1", {a, b}));
  ASSERT_DONE(Commit("s2", {{a.key, {}}, {BlockKeyOf(VoxelIndex{5, 5, 5}), {}}}));
  EXPECT_EQ(*(*maps_->Open("m"))->Read(a.key), nullptr);
  EXPECT_EQ((*maps_->Open("m"))->totals().blocks, 1U);
  ASSERT_DONE(Commit("s3", {{b.key, {}}}));
  EXPECT_EQ((*maps_->Open("m"))->totals(), MapTotals());
  EXPECT_EQ((*maps_->Open("m"))->bounds(), std::nullopt);
}

TEST_F(MapStoreTest, EveryEpochReadsAsItWasWhenItWasMade) {
  const Block first = Any({0, 0, 0}), second = Any({0, 0, 0});
  ASSERT_DONE(Commit("s1", {first}));
  const auto held = *maps_->Open("m");
  ASSERT_DONE(Commit("s2", {second}));
  EXPECT_EQ(**held->Read(first.key), first);
  EXPECT_EQ(**(*maps_->Open("m", 1))->Read(first.key), first);
  EXPECT_EQ(**(*maps_->Open("m", 2))->Read(first.key), second);
  EXPECT_EQ(*(*maps_->Open("m", 0))->Read(first.key), nullptr);
  EXPECT_CODE(maps_->Open("m", 3), kNotFound);
}

TEST_F(MapStoreTest, ASessionIsAppliedOnce) {
  const auto first = Commit("s", {Any({0, 0, 0})});
  const auto second = Commit("s", {Any({1, 0, 0})});
  ASSERT_DONE(second);
  EXPECT_EQ(second->epoch, first->epoch);
  EXPECT_EQ(second->attempt, first->attempt);
  EXPECT_EQ(calls_, 1);
  EXPECT_EQ((*maps_->Open("m"))->epoch(), 1U);
  EXPECT_EQ((*maps_->FindCommit("m", "s"))->attempt, first->attempt);
  EXPECT_EQ(*maps_->FindCommit("m", "t"), std::nullopt);
}

TEST_F(MapStoreTest, AFailingMergeLeavesNothing) {
  const CommitRequest request{.session = "s", .blocks = [](const Snapshot&) -> absl::StatusOr<std::vector<Block>> {
                                return absl::DataLossError("the scan is gone");
                              }};
  EXPECT_CODE(maps_->Commit("m", request), kDataLoss);
  const Block block = Any({0, 0, 0});
  EXPECT_CODE(Commit("s", {block, block}), kInvalidArgument) << "twice the same block";
  EXPECT_CODE(Commit("s", {{block.key, {{.position = 2}, {.position = 1}}}}), kInvalidArgument);
  EXPECT_EQ((*maps_->Open("m"))->epoch(), 0U);
  EXPECT_DONE(Commit("s", {block}));
}

TEST_F(MapStoreTest, ACommitNeedsTheLeaseItWasStartedUnder) {
  const auto leases = OpenLeases(*engine_);
  const Lease lease = *leases->Acquire("m", "s", "a", 60);
  CommitRequest request = Request("s", {Any({0, 0, 0})});
  EXPECT_CODE(maps_->Commit("m", request), kAborted) << "somebody holds a lease";
  request.lease_fence = leases->Acquire("m", "s", "a", 60)->fence;
  request.lease_fence -= 1;
  EXPECT_CODE(maps_->Commit("m", request), kAborted) << "taken over before the merge";

  // Taken over during the merge: too late for the first look, so the compare-and-set must refuse it.
  request.lease_fence = lease.fence + 1;
  request.blocks = [&, block = Any({0, 0, 0})](const Snapshot&) {
    EXPECT_DONE(leases->Acquire("m", "s", "a", 60));
    return std::vector{block};
  };
  EXPECT_CODE(maps_->Commit("m", request), kAborted);
  EXPECT_EQ((*maps_->Open("m"))->epoch(), 0U);
  request = Request("s", {Any({0, 0, 0})});
  request.lease_fence = lease.fence + 2;
  EXPECT_DONE(maps_->Commit("m", request));
}

TEST_F(MapStoreTest, TheFirstSessionMayChooseTheOrigin) {
  CommitRequest request = Request("s", {Any({0, 0, 0})});
  request.origin = Eigen::Vector3d(100, 200, 0);
  ASSERT_DONE(maps_->Commit("m", request));
  EXPECT_EQ(maps_->Find("m")->origin, Eigen::Vector3d(100, 200, 0));
  EXPECT_EQ((*maps_->Open("m"))->map().origin, Eigen::Vector3d(100, 200, 0));
  request.session = "t";
  request.origin = Eigen::Vector3d(0, 0, 0);
  EXPECT_CODE(maps_->Commit("m", request), kAborted);
  request.origin.reset();
  EXPECT_CODE(maps_->Commit("m", request), kAborted) << "aligned to epoch 0, which had no origin";
  request.base_epoch = 1;
  EXPECT_DONE(maps_->Commit("m", request));
}

TEST_F(MapStoreTest, AnOriginCannotMoveWhatIsInTheMapAlready) {
  ASSERT_DONE(Commit("s", {Any({0, 0, 0})}));
  CommitRequest request = Request("t", {Any({0, 0, 0})});
  request.origin = Eigen::Vector3d(100, 200, 0);
  EXPECT_CODE(maps_->Commit("m", request), kAborted);
}

TEST_F(MapStoreTest, TheLoserOfARaceMergesAgainOnTheNewHead) {
  // While the first session merges, the second commits: both must be in the map, the first on top of the second.
  const Block other = Any({0, 0, 0}, 10), far = Any({50, 0, 0}, 10);
  std::vector<uint64_t> heads;
  const CommitRequest request{.session = "first", .blocks = [&](const Snapshot& head) {
                                heads.push_back(head.epoch());
                                if (heads.size() == 1) {
                                  EXPECT_DONE(Commit("second", {other}));
                                }
                                const auto below = *head.Read(other.key);
                                Block merged = below == nullptr ? Block{other.key, {}} : *below;
                                merged.voxels.push_back({.position = 32767, .hits = 8});
                                return absl::StatusOr<std::vector<Block>>({merged, far});
                              }};
  const auto record = maps_->Commit("m", request);
  ASSERT_DONE(record);
  EXPECT_THAT(heads, ElementsAre(0, 1));
  EXPECT_EQ(record->epoch, 2U);
  const auto snapshot = *maps_->Open("m");
  EXPECT_EQ((*snapshot->Read(other.key))->voxels.size(), 11U);
  EXPECT_EQ(**snapshot->Read(far.key), far);
}

TEST_F(MapStoreTest, EverythingIsThereWhenItIsOpenedAgain) {
  const Block block = Any({0, 0, 0});
  ASSERT_DONE(Commit("s", {block}));
  maps_.reset();
  engine_.Reopen();
  maps_ = OpenMapStore(*engine_, {});
  EXPECT_EQ(**(*maps_->Open("m"))->Read(block.key), block);
  EXPECT_EQ(Commit("s", {})->epoch, 1U);
  EXPECT_EQ(calls_, 1);
}

TEST_F(MapStoreTest, ACommitOnADeletedMapIsRefusedEvenIfItsNameIsTakenAgain) {
  CommitRequest request = Request("s", {Any({0, 0, 0})});
  request.blocks = [&, block = Any({0, 0, 0})](const Snapshot&) {
    EXPECT_DONE(maps_->Delete("m"));
    EXPECT_DONE(maps_->Create({.name = "m"}));
    return std::vector{block};
  };
  EXPECT_CODE(maps_->Commit("m", request), kAborted);
  EXPECT_EQ((*maps_->Open("m"))->epoch(), 0U);
  EXPECT_CODE(maps_->Commit("none", request), kNotFound);
}

}  // namespace
}  // namespace mapkeep
