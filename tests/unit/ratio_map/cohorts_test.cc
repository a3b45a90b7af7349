#include "core/ratio_map/cohorts.h"

#include <gtest/gtest.h>

#include "tests/unit/ratio_map/neighbourhood_scene.h"

namespace mapkeep {
namespace {

constexpr uint32_t kFirstDay = 1440, kSecondDay = 2880;

class Scene : public NeighbourhoodScene {
 public:
  void CameOn(uint32_t day, const VoxelIndex& at, bool ground = false) { InMap(at, ground, day); }
  void LookedThrough(const VoxelIndex& at) { InSession(at, 0, 1); }
  void Met(const VoxelIndex& at) { InSession(at, 5, 0); }
  bool Forgets(const VoxelIndex& at, const MergeParameters& parameters = {}) const {
    return NeighbourhoodScene::Forgets(ForgottenWithCohort, at, parameters);
  }
};

// A car of 5 x 5 x 4 voxels from `corner`, of the second day, on a road of the first; one scan looked through `seen` of
// its voxels.
Scene CarFarAway(const VoxelIndex& corner, int seen) {
  Scene scene;
  for (int i = 0; i < 25; ++i) scene.CameOn(kFirstDay, {corner.x + i % 5, corner.y + i / 5, corner.z - 1}, true);
  for (int i = 0; i < 100; ++i) {
    const VoxelIndex at{corner.x + i % 5, corner.y + i / 5 % 5, corner.z + i / 25};
    scene.CameOn(kSecondDay, at);
    if (i < seen) scene.LookedThrough(at);
  }
  return scene;
}

TEST(Cohorts, ACarThatAFewRaysPassIsForgottenWhole) {
  const Scene scene = CarFarAway({8, 8, 8}, 6);
  EXPECT_TRUE(scene.Forgets({8, 8, 8})) << "looked through";
  EXPECT_TRUE(scene.Forgets({12, 12, 11})) << "no ray passed it";
  EXPECT_FALSE(scene.Forgets({9, 9, 7})) << "the road";
}

TEST(Cohorts, OneOrTwoRaysProveNothing) {
  EXPECT_FALSE(CarFarAway({8, 8, 8}, 2).Forgets({12, 12, 11}));
  EXPECT_FALSE(CarFarAway({8, 8, 8}, 4).Forgets({12, 12, 11})) << "4 of 100, and 5 are asked for";
  EXPECT_TRUE(CarFarAway({8, 8, 8}, 4).Forgets({12, 12, 11}, {.cohort_looked_through = 0.04}));
}

TEST(Cohorts, WhatHidesTheRestDoesNotSaveIt) {
  Scene scene = CarFarAway({8, 8, 8}, 30);
  for (int i = 60; i < 75; ++i) scene.Met({8 + i % 5, 8 + i / 5 % 5, 8 + i / 25});
  EXPECT_TRUE(scene.Forgets({12, 12, 11})) << "today's car ends in 15 of its 100 voxels";
  EXPECT_FALSE(scene.Forgets({8, 10, 10})) << "which are met";
}

TEST(Cohorts, WhatIsMetInPartStays) {
  Scene scene = CarFarAway({8, 8, 8}, 30);
  for (int i = 60; i < 76; ++i) scene.Met({8 + i % 5, 8 + i / 5 % 5, 8 + i / 25});
  EXPECT_FALSE(scene.Forgets({12, 12, 11}));
}

TEST(Cohorts, WhatCameOnAnotherDayStays) {
  Scene scene = CarFarAway({8, 8, 8}, 30);
  scene.CameOn(kFirstDay, {14, 10, 9});
  EXPECT_FALSE(scene.Forgets({14, 10, 9})) << "a post beside the car";
  EXPECT_TRUE(scene.Forgets({12, 12, 11}));
}

TEST(Cohorts, GroundThatCameWithItGoesUnlessItIsMet) {
  Scene scene = CarFarAway({8, 8, 8}, 30);
  scene.CameOn(kSecondDay, {13, 10, 8}, true);
  scene.CameOn(kSecondDay, {13, 11, 8}, true);
  scene.Met({13, 11, 8});
  EXPECT_TRUE(scene.Forgets({13, 10, 8}));
  EXPECT_FALSE(scene.Forgets({13, 11, 8}));
}

TEST(Cohorts, WhatIsFartherThanTheirReachHasNoSay) {
  Scene scene = CarFarAway({8, 8, 8}, 30);
  scene.CameOn(kSecondDay, {8, 28, 8});
  EXPECT_FALSE(scene.Forgets({8, 28, 8})) << "3 m away";
  for (int i = 0; i < 50; ++i) {
    const VoxelIndex at{8 + i % 10, 24, 8 + i / 10};
    scene.CameOn(kSecondDay, at);
    scene.Met(at);
  }
  EXPECT_TRUE(scene.Forgets({8, 8, 8}));
}

TEST(Cohorts, TheyReachOverTheFacesOfBlocks) { EXPECT_TRUE(CarFarAway({30, 30, 30}, 6).Forgets({34, 34, 33})); }

TEST(Cohorts, Eq8AloneKnowsNoCohorts) {
  EXPECT_FALSE(CarFarAway({8, 8, 8}, 30).Forgets({12, 12, 11}, {.contradicting_scans = 0}));
  EXPECT_FALSE(CarFarAway({8, 8, 8}, 30).Forgets({12, 12, 11}, {.cohort_looked_through = 1.5})) << "switched off";
}

}  // namespace
}  // namespace mapkeep
