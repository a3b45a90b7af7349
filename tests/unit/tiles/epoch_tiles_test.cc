#include "server/tiles/epoch_tiles.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/unit/tiles/site.h"

namespace mapkeep {
namespace {

constexpr size_t kMemory = 16 << 20;

std::shared_ptr<const EpochTiles> Read(Site& site, EpochTilesReader& reader, uint64_t epoch) {
  const auto snapshot = site.maps().Open("m", epoch);
  EXPECT_TRUE(snapshot.ok()) << snapshot.status();
  auto tiles = reader.Read(**snapshot);
  EXPECT_TRUE(tiles.ok()) << tiles.status();
  return *std::move(tiles);
}

TEST(EpochTiles, ACommitChangesTheTilesAboveWhatItChangedAndNoOthers) {
  Site site;
  EpochTilesReader reader(site.maps(), kMemory);
  const auto before = Read(site, reader, site.CommitAll(8000));
  const auto after = Read(site, reader, site.Commit("one", {Site::Ground(1, 1, 7, 8000)}));
  const uint32_t changed = ColumnOf(BlockKeyOf({1, 1, 0}));
  ASSERT_GT(after->tree.size(), 30U);
  size_t differ = 0;
  for (size_t i = 0; i < after->tree.size(); ++i) {
    const TileNodeId& id = after->tree[i].id;
    const auto old = before->Find(id);
    ASSERT_TRUE(old.has_value()) << NameOf(id);
    const bool holds_it = NodeAround(changed, id.level) == id;
    EXPECT_EQ(after->nodes[i] != before->nodes[*old], holds_it) << NameOf(id);
    EXPECT_EQ(after->tiles[i] != before->tiles[*old], holds_it) << NameOf(id);
    differ += holds_it ? 1 : 0;
  }
  EXPECT_LE(differ, 4U);  // a column and the squares around it
}

TEST(EpochTiles, ARollbackBringsTheIdentitiesBack) {
  Site site;
  EpochTilesReader reader(site.maps(), kMemory);
  const uint64_t first = site.CommitAll(8000);
  site.Commit("one", {Site::Ground(1, 1, 7, 8000)});
  const auto rolled = site.maps().Rollback("m", first);
  ASSERT_TRUE(rolled.ok());
  const auto before = Read(site, reader, first), after = Read(site, reader, rolled->commit.epoch);
  EXPECT_EQ(before->tiles, after->tiles);
  EXPECT_EQ(before->newest_day, after->newest_day);
  EXPECT_NE(before->all, after->all);
}

TEST(EpochTiles, NoTwoTilesHaveOneIdentity) {
  Site site;
  EpochTilesReader reader(site.maps(), kMemory);
  const auto tiles = Read(site, reader, site.CommitAll(8000));
  EXPECT_EQ(std::set(tiles->tiles.begin(), tiles->tiles.end()).size(), tiles->tiles.size());
  EXPECT_EQ(std::set(tiles->nodes.begin(), tiles->nodes.end()).size(), tiles->nodes.size());
}

TEST(EpochTiles, IdentitiesAreTheSameInEveryDaemon) {
  Site site;
  const uint64_t epoch = site.CommitAll(8000);
  EpochTilesReader one(site.maps(), kMemory), other(site.maps(), kMemory);
  EXPECT_EQ(Read(site, one, epoch)->tiles, Read(site, other, epoch)->tiles);
}

TEST(EpochTiles, AgesCountBackFromTheNewestDayThatTheEpochSaw) {
  Site site;
  EpochTilesReader reader(site.maps(), kMemory);
  EXPECT_EQ(Read(site, reader, site.CommitAll(8000))->newest_day, 8000);
  EXPECT_EQ(Read(site, reader, site.Commit("later", {Site::Ground(1, 1, 7, 8123)}))->newest_day, 8123);
}

TEST(EpochTiles, AnEmptyMapHasNone) {
  Site site;
  EpochTilesReader reader(site.maps(), kMemory);
  EXPECT_TRUE(Read(site, reader, 0)->tree.empty());
}

}  // namespace
}  // namespace mapkeep
