#include "core/dor/transients.h"

#include <gtest/gtest.h>

#include <functional>

#include "tests/unit/dor/counted_scene.h"

namespace mapkeep {
namespace {

// Two hundred scans of a place of 1 m far away, in which few voxels are hit; `said`: what a scan said of each.
CountedScene Place(const std::function<Said(int at)>& said) {
  CountedScene scene;
  scene.AddCube({100, 0, 5}, 5, said);
  scene.Finish();
  return scene;
}

// The rear of a lorry: each voxel is hit by one scan of ten, no ray comes close to the same spot again, but the place
// is clear for the twenty scans after.
Said Lorry(int at) {
  const auto scan = static_cast<uint32_t>(40 + at % 10);
  return {.hits = 1, .first_hit = scan, .last_hit = scan, .clear = 20};
}

TEST(Transients, WhatDrovePastFarAwayIsRemovedThoughNoRayPassedTheSameSpotAgain) {
  const CountedScene lorry = Place(Lorry);
  EXPECT_EQ(lorry.Removed(), 1);
  DorParameters without;
  without.transients = false;
  EXPECT_EQ(lorry.Removed(without), 0) << "it goes anyway: the scene proves nothing";
}

TEST(Transients, LeavesThatAreHitNowAndThenStay) {
  const CountedScene leaves = Place([](int at) {
    Said said = Lorry(at);
    said.first_hit = said.last_hit = static_cast<uint32_t>(37 * at % 97);
    return said;
  });
  EXPECT_EQ(leaves.Removed(), 0);
}

TEST(Transients, WhatIsInViewForAMomentOnlyStays) {
  const CountedScene glimpse = Place([](int at) {
    Said said = Lorry(at);
    said.clear = 0;
    return said;
  });
  EXPECT_EQ(glimpse.Removed(), 0);
}

TEST(Transients, ItTakesMoreClearScansTheLongerSomethingWasThere) {
  const auto waits = [](uint32_t clear) {
    return Place([clear](int) { return Said{.hits = 4, .first_hit = 20, .last_hit = 69, .clear = clear}; });
  };
  EXPECT_EQ(waits(1).Removed(), 0);
  EXPECT_EQ(waits(2).Removed(), 1);
}

TEST(Transients, SmallVoxelsOfOnePlaceAreLookedAtTogether) {
  CountedScene lorry;  // voxels of 0.1 m: ten a metre
  lorry.AddCube({200, 0, 10}, 10, [](int at) {
    Said said = Lorry(at);
    said.clear = at % 8 == 0 ? 20 : 0;
    return said;
  });
  lorry.Finish();
  DorParameters parameters;
  parameters.voxel_size = 0.1;
  EXPECT_EQ(lorry.Removed(parameters), 1);
}

TEST(Transients, WithoutTheOrderOfTheScansNothingIsForAShortWhile) {
  CountedScene lorry = Place(Lorry);
  lorry.counts.ordered = false;
  EXPECT_EQ(lorry.Removed(), 0);
}

}  // namespace
}  // namespace mapkeep
