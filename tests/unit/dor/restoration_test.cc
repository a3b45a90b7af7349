#include "core/dor/restoration.h"

#include <gtest/gtest.h>

#include "core/dor/surface.h"

namespace mapkeep {
namespace {

TEST(Restoration, ProbabilityIsEquation6) {
  EXPECT_DOUBLE_EQ(RestorationProbability(0.3, 0.5), 0.225);
  EXPECT_DOUBLE_EQ(RestorationProbability(0, 1), 0);
  EXPECT_DOUBLE_EQ(RestorationProbability(1, 1), 1);
}

TEST(Restoration, RestoresTheShareThatTheProbabilitySays) {
  for (const double probability : {0.0, 0.1, 0.5, 1.0}) {
    int restored = 0;
    for (uint64_t voxel = 0; voxel < 100; ++voxel) {
      for (size_t point = 0; point < 200; ++point) restored += IsRestored(probability, VoxelKey{voxel}, point, 1);
    }
    EXPECT_NEAR(restored / 20000.0, probability, 0.012);
  }
}

TEST(Restoration, TheDrawDependsOnVoxelPointAndSeedAlone) {
  int differ_voxel = 0, differ_point = 0, differ_seed = 0;
  for (size_t i = 0; i < 1000; ++i) {
    const bool drawn = IsRestored(0.5, VoxelKey{7}, i, 1);
    EXPECT_EQ(drawn, IsRestored(0.5, VoxelKey{7}, i, 1));
    differ_voxel += drawn != IsRestored(0.5, VoxelKey{8}, i, 1);
    differ_point += drawn != IsRestored(0.5, VoxelKey{7}, i + 1, 1);
    differ_seed += drawn != IsRestored(0.5, VoxelKey{7}, i, 2);
  }
  for (const int differ : {differ_voxel, differ_point, differ_seed}) EXPECT_NEAR(differ, 500, 80);
}

TEST(Surface, MomentsOfAMaskAreThoseOfItsSubVoxels) {
  // Sub-voxels (1, 2, 3) and (3, 0, 2).
  const uint64_t mask = uint64_t{1} << (1 + 4 * 2 + 16 * 3) | uint64_t{1} << (3 + 16 * 2);
  const Moments moments = MomentsOf(mask);
  EXPECT_EQ(moments.count, 2);
  EXPECT_EQ(moments.sum, (std::array<int64_t, 3>{4, 2, 5}));
  EXPECT_EQ(moments.products, (std::array<int64_t, 6>{10, 2, 9, 4, 6, 13}));
  const Moments shifted = moments.Shifted({4, 0, -4});
  EXPECT_EQ(shifted.sum, (std::array<int64_t, 3>{12, 2, -3}));
  EXPECT_EQ(shifted.products, (std::array<int64_t, 6>{5 * 5 + 7 * 7, 10, -5 - 14, 4, -2, 1 + 4}));
  EXPECT_TRUE(MeanInVoxel(mask).isApprox(Eigen::Vector3d(0.625, 0.375, 0.75)));
}

TEST(Surface, ALayerIsPlanarWithAVerticalNormalAndALineIsNot) {
  const Surface layer = SurfaceOf(MomentsOf(0xffff));
  EXPECT_NEAR(std::abs(layer.normal.z()), 1, 1e-9);
  EXPECT_NEAR(layer.planarity(), 1, 1e-6);
  EXPECT_NEAR(SurfaceOf(MomentsOf(0xf)).planarity(), 0, 1e-6);
  EXPECT_EQ(SurfaceOf(MomentsOf(1)).planarity(), 0);
  EXPECT_EQ(SurfaceOf(MomentsOf(0)).planarity(), 0);
}

}  // namespace
}  // namespace mapkeep
