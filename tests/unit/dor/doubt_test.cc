#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/dor/surroundings.h"
#include "tests/unit/dor/counted_scene.h"
#include "tests/unit/dor/scenes.h"

namespace mapkeep {
namespace {

// A crown of leaves: every voxel was hit five times, looked through fifteen times, by turns; a few edges were clear
// once.
CountedScene Leaves() {
  CountedScene scene;
  scene.AddCube({10, 10, 20}, 6, [](int at) {
    return Said{.hits = 5, .exposures = 15, .returns = 4, .confirmed = at % 20 == 0 ? 1U : 0U};
  });
  scene.Finish();
  return scene;
}

DorParameters WithoutDoubt() {
  DorParameters parameters;
  parameters.doubt = false;
  return parameters;
}

TEST(Doubt, LeavesThatAreHitAndLookedThroughByTurnsStay) {
  EXPECT_EQ(Leaves().Removed(), 0);
  EXPECT_EQ(Leaves().Removed(WithoutDoubt()), 1) << "they stay anyway: the scene proves nothing";
}

TEST(Doubt, WhatWasThereOnceAndThenLookedThroughGoes) {
  CountedScene scene;
  scene.AddCube({10, 10, 20}, 6, [](int at) {
    return Said{.hits = 1, .exposures = 15, .returns = 0, .confirmed = at % 2 == 0 ? 8U : 0U};
  });
  scene.Finish();
  EXPECT_EQ(scene.Removed(), 1);
}

TEST(Doubt, ALaneInWhichCarFollowsCarIsClearBetweenThemAndGoes) {
  CountedScene scene;
  scene.AddCube({10, 10, 20}, 6, [](int) { return Said{.hits = 8, .exposures = 40, .returns = 4, .confirmed = 30}; });
  scene.Finish();
  EXPECT_EQ(scene.Removed(), 1);
}

TEST(Doubt, WhatIsHitMostOfTheTimeSpeaksForTheEdgeBesideIt) {
  // A wall, and voxels at its edge that are seen past more often than hit.
  const auto edge = [](bool with_wall) {
    CountedScene scene;
    scene.AddCube({10, 10, 20}, 2, [](int) { return Said{.hits = 3, .exposures = 9, .returns = 1, .confirmed = 1}; });
    if (with_wall) scene.AddCube({6, 10, 18}, 4, [](int) { return Said{.hits = 40}; });
    scene.Finish();
    return scene.Removed();
  };
  EXPECT_GT(edge(false), 0);
  EXPECT_EQ(edge(true), 0);
}

TEST(Doubt, WithoutTheOrderOfTheScansReturnsSayNothing) {
  CountedScene scene = Leaves();
  scene.counts.ordered = false;
  const std::vector<VoxelIndex> all = {{12, 12, 22}};
  const auto every = [](uint32_t) { return true; };
  EXPECT_EQ(Surroundings(scene.voxels.grid, scene.counts, 0.2, 0.6, every).Around(all[0]).return_share(), 0);
}

TEST(Doubt, SurroundingsReachTwoCellsOfTheSameSizeForAnyVoxel) {
  // Voxels of 0.1 m: cells of two, so that 4 voxels to the low side belong to the cells around, and 5 at the high one.
  CountedScene scene;
  for (int x = -12; x < 12; ++x) scene.AddCube({x, 0, 0}, 1, [](int) { return Said{.hits = 1, .exposures = 3}; });
  scene.Finish();
  const auto every = [](uint32_t) { return true; };
  const Surroundings fine(scene.voxels.grid, scene.counts, 0.1, 0.6, every);
  EXPECT_EQ(fine.Around({0, 0, 0}).voxels, 10U);
  EXPECT_EQ(fine.Around({-1, 0, 0}).voxels, 10U);
  EXPECT_EQ(fine.Around({0, 0, 0}).unsteady_hits, 10U);
  EXPECT_DOUBLE_EQ(fine.Around({0, 0, 0}).stability(), 0.25);
  const Surroundings coarse(scene.voxels.grid, scene.counts, 0.4, 0.2, every);
  EXPECT_EQ(coarse.Around({0, 0, 0}).voxels, 5U);
  EXPECT_EQ(coarse.Around({0, 0, 0}).unsteady_hits, 0U) << "R is not below 0.2";
}

// A point ahead that is there in some scans and not in others, before a wall.
TEST(Doubt, AReturnIsAHitAfterExposures) {
  Session session;
  const Pose pose = At(0.05, 0.05, 0.05);
  for (const bool there : {true, true, false, false, true, false, true, true, false}) {
    Add(session, pose, {{there ? 5.05 : 10.05, 0.05, 0.05}});
  }
  for (size_t i = 0; i < session.scans.size(); ++i) session.scans[i].time = static_cast<double>(i);
  const auto voxels = CollectVoxels(session.source(), session.poses, 0.2, {}, {});
  ASSERT_TRUE(voxels.ok());
  const auto counts = CountVoxels(session.source(), session.poses, 0.2, *voxels, {}, {});
  ASSERT_TRUE(counts.ok());
  const uint32_t id = voxels->grid.Find({25, 0, 0});
  EXPECT_EQ(counts->hits[id], 5U);
  EXPECT_EQ(counts->exposures[id], 4U);
  EXPECT_EQ(counts->returns[id], 2U);
}

}  // namespace
}  // namespace mapkeep
