#include "server/pipeline/plan_cache.h"

#include <absl/strings/str_cat.h>
#include <gtest/gtest.h>

#include <atomic>

#include "core/voxels/normal.h"
#include "server/pipeline/plan_codec.h"
#include "tests/unit/storage/status_matchers.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {
namespace {

PlanPart SomePlan() {
  return {.walls = {{-3, -2, 0x8001}, {5, -2, 2}, {-1000000, 7, 0xffff}},
          .floors = {{-1, -1, -1.75F}, {4, -1, 0.25F}, {2, 3, 100}}};
}

TEST(PlanCodec, GivesBackThePlan) {
  for (const PlanPart& plan : {SomePlan(), PlanPart{}}) {
    const auto decoded = DecodePlan(*EncodePlan(plan));
    ASSERT_DONE(decoded);
    EXPECT_EQ(decoded->walls, plan.walls);
    EXPECT_EQ(decoded->floors, plan.floors);
  }
}

TEST(PlanCodec, RefusesWhatIsNoPlan) {
  const std::string bytes = *EncodePlan(SomePlan());
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_CODE(DecodePlan(bytes.substr(0, size)).status(), kDataLoss) << size << " bytes";
  }
  std::string newer = bytes, larger = bytes;
  newer[1] = 2;
  EXPECT_CODE(DecodePlan(newer).status(), kDataLoss);
  larger[5] = '\x7f';  // walls by the billion
  EXPECT_CODE(DecodePlan(larger).status(), kDataLoss);
}

class PlanCacheTest : public testing::Test {
 protected:
  PlanCacheTest() {
    EXPECT_DONE(maps_->Create({.name = "m", .voxel_size = 0.2}));
    Commit("founder", {VoxelIndex{5, 5, 0}, VoxelIndex{500, 5, 0}});
  }

  // Ground about a corner, and a wall on it that faces x, a tile each.
  void Commit(const std::string& session, const std::vector<VoxelIndex>& corners, uint16_t hits = 80) {
    CommitRequest request{.session = session};
    request.blocks = [&corners, hits](const Snapshot&) -> absl::StatusOr<std::vector<Block>> {
      std::vector<Block> blocks;
      for (const VoxelIndex& corner : corners) {
        Block block{.key = BlockKeyOf(VoxelKeyOf(corner))};
        for (int y = 0; y < 8; ++y) {
          for (int z = 0; z < 8; ++z) {
            const VoxelKey key = VoxelKeyOf(VoxelIndex{corner.x, corner.y + y, corner.z + z});
            if (BlockKeyOf(key) != block.key) continue;
            block.voxels.push_back(
                {.position = PositionInBlock(key),
                 .hits = hits,
                 .ground = z == 0,
                 .is_static = true,
                 .mean = {128, 128, 128},
                 .normal = EncodeNormal(z == 0 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitX()),
                 .mask = 1});
          }
        }
        std::ranges::sort(block.voxels, {}, &Voxel::position);
        blocks.push_back(std::move(block));
      }
      return blocks;
    };
    EXPECT_DONE(maps_->Commit("m", request));
  }

  TestEngine engine_;
  std::unique_ptr<MapStore> maps_ = OpenMapStore(*engine_, {});
};

TEST_F(PlanCacheTest, AnotherDaemonReadsWhatOneMade) {
  PlanCache first, second;
  const auto snapshot = *maps_->Open("m");
  const auto made = first.PlanOf(*snapshot);
  ASSERT_DONE(made);
  EXPECT_EQ(first.made(), 2U);
  EXPECT_EQ(first.not_stored(), 0U);
  const auto read = second.PlanOf(*snapshot);
  ASSERT_DONE(read);
  EXPECT_EQ(second.made(), 0U);
  EXPECT_FALSE((*made)->tiles_with_floor().empty());
  EXPECT_EQ((*read)->tiles_with_floor(), (*made)->tiles_with_floor());
  for (const WallPlan::TileIndex& tile : (*made)->tiles_with_floor()) {
    EXPECT_EQ((*read)->TileAt(tile)->walls, (*made)->TileAt(tile)->walls);
  }
}

TEST_F(PlanCacheTest, OnlyWhatACommitTouchedIsMadeAgain) {
  PlanCache plans;
  ASSERT_DONE(plans.PlanOf(**maps_->Open("m")));
  Commit("again", {VoxelIndex{500, 5, 0}, VoxelIndex{500, 500, 0}}, 88);
  ASSERT_DONE(plans.PlanOf(**maps_->Open("m")));
  EXPECT_EQ(plans.made(), 4U) << "two at first, one changed, one new";
  PlanCache restarted;
  ASSERT_DONE(restarted.PlanOf(**maps_->Open("m")));
  EXPECT_EQ(restarted.made(), 0U);
}

TEST_F(PlanCacheTest, MemoryGrowsWithTheMapAndNotWithItsHistory) {
  PlanCache plans;
  ASSERT_DONE(plans.PlanOf(**maps_->Open("m")));
  const size_t once = plans.bytes();
  EXPECT_GT(once, 0U);
  for (uint16_t day = 0; day < 20; ++day) {
    Commit(absl::StrCat("day", day), {VoxelIndex{500, 5, 0}}, 100 + 8 * day);
    ASSERT_DONE(plans.PlanOf(**maps_->Open("m")));
  }
  EXPECT_EQ(plans.made(), 22U);
  EXPECT_EQ(plans.bytes(), once);
  const auto old = *maps_->Open("m", 1);
  const auto from_store = plans.PlanOf(*old);
  ASSERT_DONE(from_store);
  EXPECT_EQ(plans.made(), 22U) << "what went from memory is stored";
  EXPECT_EQ((*from_store)->tiles_with_floor().size(), 2U);
}

TEST_F(PlanCacheTest, MayBeStoppedAndGoesOnWithWhatItHas) {
  PlanCache plans;
  const auto snapshot = *maps_->Open("m");
  std::atomic<int> asked = 0;
  EXPECT_CODE(plans.PlanOf(*snapshot, [&asked] { return ++asked == 1; }).status(), kCancelled);
  EXPECT_GE(asked, 2);
  EXPECT_LE(plans.made(), 1U);
  ASSERT_DONE(plans.PlanOf(*snapshot, [] { return true; }));
  EXPECT_EQ(plans.made(), 2U);
}

TEST_F(PlanCacheTest, KeepsNoMoreThanItMay) {
  PlanCache whole, small(1);
  const auto all = *whole.PlanOf(**maps_->Open("m")), few = *small.PlanOf(**maps_->Open("m"));
  EXPECT_LT(small.bytes(), whole.bytes());
  EXPECT_GT(small.bytes(), 0U);
  EXPECT_EQ(few->tiles_with_floor(), all->tiles_with_floor());
}

TEST_F(PlanCacheTest, APlanThatIsDamagedOrOfAnotherVersionIsMadeAnew) {
  const auto snapshot = *maps_->Open("m");
  const auto tiles = *snapshot->TileEntries({});
  ASSERT_DONE(snapshot->StoreDerived(tiles[0], "a plan of the year 2031"));
  PlanCache plans, next;
  ASSERT_DONE(plans.PlanOf(*snapshot));
  EXPECT_EQ(plans.made(), 2U);
  ASSERT_DONE(next.PlanOf(*snapshot));
  EXPECT_EQ(next.made(), 0U) << "it took the place of what was there";
}

}  // namespace
}  // namespace mapkeep
