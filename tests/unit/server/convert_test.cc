#include "server/rpc/convert.h"

#include <gtest/gtest.h>

#include <limits>

namespace mapkeep {
namespace {

v1::Box Box(const Eigen::Vector3d& min, const Eigen::Vector3d& max) {
  v1::Box box;
  *box.mutable_min() = ToProto(min);
  *box.mutable_max() = ToProto(max);
  return box;
}

TEST(VoxelRange, BoxesThatShareAFaceShareNoVoxelAndMissNone) {
  for (const double voxel_size : {0.05, 0.2, 0.3}) {
    for (int i = -40; i < 40; ++i) {
      const double face = 0.1 * i;
      const auto low = FromProto(Box({-10, -1, -1}, {face, 1, 1}), voxel_size);
      const auto high = FromProto(Box({face, -1, -1}, {10, 1, 1}), voxel_size);
      ASSERT_TRUE(low.ok() && high.ok());
      EXPECT_EQ(low->last.x + 1, high->first.x) << face << " at " << voxel_size;
    }
  }
}

TEST(VoxelRange, ABoxOnVoxelBordersHoldsTheVoxelsBetween) {
  const auto range = FromProto(Box({0, -6.4, 0.2}, {6.4, 0, 0.4}), 0.2);
  ASSERT_TRUE(range.ok());
  EXPECT_EQ(range->first, (VoxelIndex{0, -32, 1}));
  EXPECT_EQ(range->last, (VoxelIndex{31, -1, 1}));
}

TEST(VoxelRange, AHugeBoxEndsWhereTheMapDoes) {
  const auto range = FromProto(Box({-1e300, -1e300, -1e300}, {1e300, 1e300, 1e300}), 0.2);
  ASSERT_TRUE(range.ok());
  EXPECT_EQ(range->first.x, -kVoxelLimit);
  EXPECT_EQ(range->last.z, kVoxelLimit - 1);
  const auto beyond = FromProto(Box({1e299, 0, 0}, {1e300, 1, 1}), 0.2);
  ASSERT_TRUE(beyond.ok());
  EXPECT_FALSE(beyond->HasVoxels());
}

TEST(VoxelRange, BadBoxesAreRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(absl::IsInvalidArgument(FromProto(Box({0, 0, 0}, {1, 0, 1}), 0.2).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(FromProto(Box({0, 0, 2}, {1, 1, 1}), 0.2).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(FromProto(Box({0, nan, 0}, {1, 1, 1}), 0.2).status()));
}

TEST(VoxelBlock, HoldsTheStaticVoxelsOfTheRange) {
  const Block block{.key = BlockKeyOf(VoxelIndex{-1, 0, 2}),
                    .voxels = {{.position = 0, .hits = 8, .is_static = true, .mask = 1},
                               {.position = 1, .hits = 16, .ground = true, .is_static = true, .mask = 2},
                               {.position = 2, .hits = 24, .is_new = true, .mask = 4}}};
  const auto all = ToProto(block, {}, true);
  ASSERT_TRUE(all.has_value());
  EXPECT_EQ(all->x(), -1);
  EXPECT_EQ(all->z(), 2);
  EXPECT_EQ(all->positions_size(), 3);
  EXPECT_EQ(all->flags(), "\2\3\4");
  EXPECT_EQ(all->means().size(), 9U);
  EXPECT_EQ(all->normals().size(), 6U);
  const auto fixed = ToProto(block, {}, false);
  ASSERT_TRUE(fixed.has_value());
  EXPECT_EQ(fixed->positions_size(), 2);
  const VoxelIndex second{-31, 0, 64};
  const auto one = ToProto(block, VoxelRange{second, second}, true);
  ASSERT_TRUE(one.has_value());
  ASSERT_EQ(one->positions_size(), 1);
  EXPECT_EQ(one->hits(0), 16U);
  EXPECT_FALSE(ToProto(block, VoxelRange{{0, 0, 0}, {0, 0, 0}}, true).has_value());
}

}  // namespace
}  // namespace mapkeep
