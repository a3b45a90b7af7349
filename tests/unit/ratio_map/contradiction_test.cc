#include "core/ratio_map/contradiction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

namespace mapkeep {
namespace {

// A map and a session voxel by voxel; 0.2 m.
class Scene {
 public:
  void InMap(const VoxelIndex& at, bool ground = false) {
    const BlockKey key = BlockKeyOf(BlockOf(at));
    Block& block = map_.try_emplace(key, Block{.key = key}).first->second;
    block.voxels.push_back({.position = PositionInBlock(at), .hits = 400, .ground = ground});
    std::ranges::sort(block.voxels, {}, &Voxel::position);
  }

  void InSession(const VoxelIndex& at, uint32_t hits, uint32_t exposures) {
    std::vector<SessionVoxel>& voxels = session_[BlockKeyOf(BlockOf(at))];
    voxels.push_back({.key = VoxelKeyOf(at), .hits = hits, .exposures = exposures});
    std::ranges::sort(voxels, {}, &SessionVoxel::key);
  }

  // Whether the voxel of the map is forgotten with others.
  bool Forgets(const VoxelIndex& at, const MergeParameters& parameters = {}) const {
    BlockNeighbourhood map{};
    SessionNeighbourhood session;
    const auto around = NeighbourhoodOf(BlockOf(at));
    for (size_t i = 0; i < around.size(); ++i) {
      const BlockKey key = BlockKeyOf(around[i]);
      if (const auto found = map_.find(key); found != map_.end()) map[i] = &found->second;
      if (const auto found = session_.find(key); found != session_.end()) session[i] = found->second;
    }
    return std::ranges::binary_search(ForgottenWithOthers(map, session, 0.2, parameters), PositionInBlock(at));
  }

 private:
  std::map<BlockKey, Block> map_;
  std::map<BlockKey, std::vector<SessionVoxel>> session_;
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
