#include "core/voxels/ray_walk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace mapkeep {
namespace {

using ::testing::ElementsAre;

VoxelIndex VoxelOf(const Eigen::Vector3d& p) { return *VoxelIndexOf(p, 1.0); }

std::vector<VoxelIndex> Walked(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  RayWalk walk(from, VoxelOf(from), to, VoxelOf(to));
  std::vector<VoxelIndex> voxels = {{walk.at()[0], walk.at()[1], walk.at()[2]}};
  while (!walk.done() && voxels.size() < 10000) {
    walk.Step();
    voxels.push_back({walk.at()[0], walk.at()[1], walk.at()[2]});
  }
  return voxels;
}

TEST(RayWalk, AlongAnAxisItTakesEveryVoxelInTurn) {
  EXPECT_THAT(Walked({0.5, 0.5, 0.5}, {3.5, 0.5, 0.5}),
              ElementsAre(VoxelIndex{0, 0, 0}, VoxelIndex{1, 0, 0}, VoxelIndex{2, 0, 0}, VoxelIndex{3, 0, 0}));
  EXPECT_THAT(Walked({0.5, 0.5, 0.5}, {0.5, -1.5, 0.5}),
              ElementsAre(VoxelIndex{0, 0, 0}, VoxelIndex{0, -1, 0}, VoxelIndex{0, -2, 0}));
}

TEST(RayWalk, InsideOneVoxelItIsDoneAtOnce) {
  EXPECT_THAT(Walked({0.1, 0.1, 0.1}, {0.9, 0.9, 0.9}), ElementsAre(VoxelIndex{0, 0, 0}));
}

TEST(RayWalk, AcrossASlopeItTakesTheVoxelsTheSegmentCuts) {
  // y = 0.25 + x / 2: y reaches 1 at x = 1.5.
  EXPECT_THAT(Walked({0, 0.25, 0.5}, {2.2, 1.35, 0.5}),
              ElementsAre(VoxelIndex{0, 0, 0}, VoxelIndex{1, 0, 0}, VoxelIndex{1, 1, 0}, VoxelIndex{2, 1, 0}));
}

TEST(RayWalk, ThroughACornerItStepsTheLowerAxisFirst) {
  EXPECT_THAT(Walked({0.5, 0.5, 0.5}, {1.5, 1.5, 1.5}),
              ElementsAre(VoxelIndex{0, 0, 0}, VoxelIndex{1, 0, 0}, VoxelIndex{1, 1, 0}, VoxelIndex{1, 1, 1}));
  EXPECT_THAT(Walked({0.5, 0.5, 0.5}, {-0.5, -0.5, 0.5}),
              ElementsAre(VoxelIndex{0, 0, 0}, VoxelIndex{-1, 0, 0}, VoxelIndex{-1, -1, 0}));
}

TEST(RayWalk, SaysWhenItEntersAndLeavesAVoxel) {
  RayWalk walk({0.5, 0.5, 0.5}, {0, 0, 0}, {4.5, 0.5, 0.5}, {4, 0, 0});
  EXPECT_DOUBLE_EQ(walk.entry_time(), 0);
  EXPECT_DOUBLE_EQ(walk.exit_time(), 0.125);
  walk.Step();
  EXPECT_DOUBLE_EQ(walk.entry_time(), 0.125);
  EXPECT_DOUBLE_EQ(walk.exit_time(), 0.375);
}

TEST(RayWalk, TakesAsManyStepsAsTheIndicesDifferAndOnlyVoxelsThatTheSegmentMeets) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-20, 20);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d from(any(random), any(random), any(random)), to(any(random), any(random), any(random));
    const auto voxels = Walked(from, to);
    const VoxelIndex a = VoxelOf(from), b = VoxelOf(to);
    ASSERT_EQ(voxels.size(), 1U + std::abs(a.x - b.x) + std::abs(a.y - b.y) + std::abs(a.z - b.z));
    ASSERT_EQ(voxels.back(), b);
    for (const VoxelIndex& voxel : voxels) {
      double enter = 0, leave = 1;
      for (int axis = 0; axis < 3; ++axis) {
        const double low = axis == 0 ? voxel.x : axis == 1 ? voxel.y : voxel.z;
        const double t0 = (low - from[axis]) / (to[axis] - from[axis]);
        const double t1 = (low + 1 - from[axis]) / (to[axis] - from[axis]);
        enter = std::max(enter, std::min(t0, t1));
        leave = std::min(leave, std::max(t0, t1));
      }
      ASSERT_LE(enter, leave + 1e-9);
    }
  }
}

TEST(RayWalk, LeavingACubeComesOutWhereWalkingWould) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> any(-60, 60);
  std::uniform_int_distribution<int> whole(-40, 40);
  for (int i = 0; i < 2000; ++i) {
    Eigen::Vector3d from(any(random), any(random), any(random)), to(any(random), any(random), any(random));
    // Every other ray runs from one voxel corner to another, through as many ties as there can be.
    if (i % 2 == 0) from = Eigen::Vector3d(whole(random), whole(random), whole(random));
    if (i % 2 == 0) to = from + whole(random) * Eigen::Vector3d(1, i % 4 == 0 ? 1 : -1, i % 8 == 0 ? 1 : 0);
    RayWalk slow(from, VoxelOf(from), to, VoxelOf(to)), fast = slow;
    while (!fast.done()) {
      const int bits = i % 3 == 0 ? 5 : 3;
      const auto start = fast.at();
      const auto inside = [&](const auto& at) {
        return at[0] >> bits == start[0] >> bits && at[1] >> bits == start[1] >> bits &&
               at[2] >> bits == start[2] >> bits;
      };
      fast.LeaveCube(bits);
      while (!slow.done() && inside(slow.at())) slow.Step();
      ASSERT_EQ(fast.at(), slow.at());
      ASSERT_EQ(fast.entry_time(), slow.entry_time());
    }
  }
}

}  // namespace
}  // namespace mapkeep
