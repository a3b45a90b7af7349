#include "core/ratio_map/forgetting.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

namespace mapkeep {
namespace {

constexpr uint64_t kOld = 0xff;
constexpr VoxelIndex kRoad{9, 9, 9};

uint16_t PositionOf(const VoxelIndex& at) { return PositionInBlock(at); }

// A voxel of the road and what stood on it, all of it in one block.
Block RoadWith(const std::vector<VoxelIndex>& car) {
  Block block{.key = BlockKeyOf({0, 0, 0})};
  block.voxels.push_back({.position = PositionOf(kRoad), .hits = 400, .ground = true, .mask = kOld});
  for (const VoxelIndex& at : car) block.voxels.push_back({.position = PositionOf(at), .hits = 80, .mask = kOld});
  return block;
}

// The road's voxel after a session that met it and says that `left` have left, or nullptr.
uint64_t MaskAfter(const std::vector<VoxelIndex>& left, uint32_t hits_on_the_road) {
  Departed departed;
  for (const VoxelIndex& at : left) departed.forgotten.push_back(PositionOf(at));
  std::array<const Departed*, 27> around{};
  around[13] = &departed;
  const std::vector<SessionVoxel> session = {{.key = VoxelKeyOf(kRoad), .hits = hits_on_the_road, .exposures = 1}};
  const Block remembered = Remembered(RoadWith(left), around, session);
  EXPECT_EQ(remembered.voxels.size(), 1U) << "what is forgotten is not remembered";
  return FindVoxel(remembered, PositionOf(kRoad))->mask;
}

const std::vector<VoxelIndex> kWheel = {{8, 8, 10}, {9, 8, 10}, {10, 8, 10}, {8, 9, 10}, {9, 9, 10}};

TEST(Forgetting, TheRoadBelowACarThatLeftIsWhereTheSessionMetIt) {
  EXPECT_EQ(MaskAfter(kWheel, 2), 0U);
  EXPECT_EQ(MaskAfter(kWheel, 0), kOld) << "unless it did not meet it";
}

TEST(Forgetting, AFewVoxelsThatLeftBesideOneDoNotSpeakForIt) {
  EXPECT_EQ(MaskAfter({kWheel.begin(), kWheel.begin() + 4}, 2), kOld);
}

TEST(Forgetting, WhatLeftIsKnownAcrossTheFacesOfBlocks) {
  Block road{.key = BlockKeyOf({0, 0, 0})};
  const VoxelIndex edge{9, 9, kBlockSize - 1};
  road.voxels.push_back({.position = PositionOf(edge), .hits = 400, .ground = true, .mask = kOld});
  Departed above;
  for (const VoxelIndex& at : kWheel) above.contradicted.push_back(PositionOf({at.x, at.y, 0}));
  std::array<const Departed*, 27> around{};
  around[22] = &above;  // the block on top
  const std::vector<SessionVoxel> session = {{.key = VoxelKeyOf(edge), .hits = 2}};
  EXPECT_EQ(Remembered(road, around, session).voxels.front().mask, 0U);
}

TEST(Forgetting, WhatIsContradictedIsLeftToTheDecayRule) {
  const VoxelIndex car{3, 3, 3};
  Block block{.key = BlockKeyOf({0, 0, 0})};
  block.voxels.push_back({.position = PositionOf(car), .hits = 80});
  const std::vector<SessionVoxel> seen = {{.key = VoxelKeyOf(car), .exposures = 3}};
  BlockNeighbourhood map{};
  map[13] = &block;
  SessionNeighbourhood session;
  session[13] = seen;
  const Departed departed = DepartedFrom(map, session, 0.2, {.cohort_looked_through = 2});
  EXPECT_TRUE(departed.forgotten.empty());
  EXPECT_EQ(departed.contradicted, std::vector<uint16_t>{PositionOf(car)});
}

}  // namespace
}  // namespace mapkeep
