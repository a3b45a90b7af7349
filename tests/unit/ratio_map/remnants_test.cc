#include "core/ratio_map/remnants.h"

#include <gtest/gtest.h>

#include "tests/unit/ratio_map/neighbourhood_scene.h"

namespace mapkeep {
namespace {

// A road that the map knows. On it the session kept a column of voxels, 2 x 2 x 6.
class Remnants : public testing::Test {
 protected:
  Remnants() {
    for (int x = 0; x < 16; ++x) {
      for (int y = 0; y < 16; ++y) scene_.InMap({x, y, 0}, true);
    }
    for (int z = 2; z < 8; ++z) {
      for (const auto& [x, y] : {std::pair{6, 6}, {7, 6}, {6, 7}, {7, 7}}) scene_.InSession({x, y, z}, 20, 3);
    }
  }

  // Removed voxels on one side of the column, `height` of its six layers high.
  void RemoveBeside(int height) {
    for (int z = 2; z < 2 + height; ++z) {
      for (int y = 5; y <= 8; ++y) scene_.RemovedBySession({8, y, z});
    }
  }

  bool IsRemnant(const VoxelIndex& at, double share = MergeParameters{}.remnant_share) const {
    const auto rule = [share](const BlockNeighbourhood& map, const SessionNeighbourhood& session, double,
                              MergeParameters parameters) {
      parameters.remnant_share = share;
      return RemnantsIn(map, session, parameters);
    };
    return scene_.Forgets(rule, at);
  }

  NeighbourhoodScene scene_;
};

TEST_F(Remnants, WhatSomethingThatMovedLeftIsNotMerged) {
  RemoveBeside(6);
  for (int z = 2; z < 8; ++z) scene_.RemovedBySession({5, 6, z});
  EXPECT_TRUE(IsRemnant({6, 6, 4}));
  EXPECT_TRUE(IsRemnant({7, 7, 7}));
  EXPECT_FALSE(IsRemnant({6, 6, 4}, 1)) << "switched off";
}

TEST_F(Remnants, WhatSomethingPassedOnOneSideIsMerged) {
  RemoveBeside(6);
  EXPECT_FALSE(IsRemnant({6, 6, 4}));
  EXPECT_FALSE(IsRemnant({7, 7, 4})) << "the side that it passed";
}

TEST_F(Remnants, WhatTouchesWhatTheMapKnowsIsMerged) {
  RemoveBeside(6);
  for (int z = 2; z < 8; ++z) {
    scene_.RemovedBySession({5, 6, z});
    scene_.InMap({6, 8, z});
  }
  EXPECT_FALSE(IsRemnant({6, 7, 4}));
}

TEST_F(Remnants, TheGroundUnderItIsMerged) {
  RemoveBeside(6);
  for (int z = 2; z < 8; ++z) scene_.RemovedBySession({5, 6, z});
  scene_.InSession({6, 6, 0}, 20, 0);
  EXPECT_FALSE(IsRemnant({6, 6, 0}));
}

TEST_F(Remnants, WhereTheMapKnowsNothingAllIsMerged) {
  NeighbourhoodScene unknown;
  for (int x = 0; x < 3; ++x) unknown.InSession({x, 0, 0}, 20, 3);
  unknown.RemovedBySession({1, 1, 0});
  unknown.RemovedBySession({1, 0, 1});
  scene_ = unknown;
  EXPECT_FALSE(IsRemnant({1, 0, 0}));
}

}  // namespace
}  // namespace mapkeep
