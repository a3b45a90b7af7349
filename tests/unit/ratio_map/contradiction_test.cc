#include "core/ratio_map/contradiction.h"

#include <gtest/gtest.h>

#include "tests/unit/ratio_map/neighbourhood_scene.h"

namespace mapkeep {
namespace {

class Scene : public NeighbourhoodScene {
 public:
  bool Forgets(const VoxelIndex& at, const MergeParameters& parameters = {}) const {
    return NeighbourhoodScene::Forgets(ForgottenWithOthers, at, parameters);
  }
};

// A car of 3 x 3 x 3 voxels from `corner`; the session looked through all of it but the one in the middle.
Scene CarThatLeft(const VoxelIndex& corner) {
  Scene scene;
  for (int i = 0; i < 27; ++i) {
    const VoxelIndex at{corner.x + i % 3, corner.y + i / 3 % 3, corner.z + i / 9};
    scene.InMap(at);
    if (i != 13) scene.InSession(at, 0, 8);
  }
  return scene;
}

TEST(Contradiction, WhatNoRayPassedGoesWithTheCarThatItWasAPartOf) {
  EXPECT_TRUE(CarThatLeft({8, 8, 8}).Forgets({9, 9, 9}));
  EXPECT_FALSE(CarThatLeft({8, 8, 8}).Forgets({8, 8, 8})) << "what is contradicted itself is eq. 8's affair";
  EXPECT_FALSE(CarThatLeft({8, 8, 8}).Forgets({9, 9, 9}, {.contradicted_share = 1.5})) << "switched off";
}

TEST(Contradiction, ItReachesOverTheFacesOfBlocks) { EXPECT_TRUE(CarThatLeft({31, 30, 31}).Forgets({32, 31, 32})); }

TEST(Contradiction, AWallBesideACarThatLeftStays) {
  Scene scene = CarThatLeft({8, 8, 8});
  for (int x = 4; x < 16; ++x) {
    for (int z = 6; z < 14; ++z) {
      scene.InMap({x, 12, z});
      if ((x + z) % 2 == 0) scene.InSession({x, 12, z}, 20, 0);
    }
  }
  EXPECT_FALSE(scene.Forgets({9, 12, 10}));
}

TEST(Contradiction, GroundStaysWhateverLeft) {
  Scene scene = CarThatLeft({8, 8, 8});
  scene.InMap({9, 9, 7}, true);
  EXPECT_FALSE(scene.Forgets({9, 9, 7}));
}

TEST(Contradiction, WithoutContradictionNothingIsForgotten) {
  EXPECT_FALSE(CarThatLeft({8, 8, 8}).Forgets({9, 9, 9}, {.contradicting_scans = 0}));
  EXPECT_FALSE(CarThatLeft({8, 8, 8}).Forgets({9, 9, 9}, {.contradicting_scans = 9}));
}

}  // namespace
}  // namespace mapkeep
