#include "client/mapkeep/wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

/// Block (-1, 2, 3) with two voxels.
v1::VoxelBlock TwoVoxels() {
  v1::VoxelBlock wire;
  wire.set_x(-1);
  wire.set_y(2);
  wire.set_z(3);
  for (const uint32_t position : {5U, 32767U}) {
    wire.add_positions(position);
    wire.add_hits(position + 1);
    wire.add_exposures(65535);
    wire.add_masks(uint64_t{1} << 63);
    wire.add_first_seen(100);
    wire.add_last_seen(200);
  }
  wire.set_flags(std::string("\x01\x02", 2));
  wire.set_means("abcdef");
  wire.set_normals("ghij");
  wire.set_intensities("\x10\xff");
  return wire;
}

std::string ErrorOf(const v1::VoxelBlock& wire) { return std::string(FromWire(wire).status().message()); }

TEST(BlockFromTheWire, CarriesEveryColumn) {
  const absl::StatusOr<Block> block = FromWire(TwoVoxels());
  ASSERT_TRUE(block.ok()) << block.status();
  EXPECT_EQ(BlockIndexOf(block->key), (VoxelIndex{-1, 2, 3}));
  const Voxel ground{.position = 5,
                     .hits = 6,
                     .exposures = 65535,
                     .ground = true,
                     .is_static = false,
                     .mean = {'a', 'b', 'c'},
                     .normal = {'g', 'h'},
                     .intensity = 0x10,
                     .mask = uint64_t{1} << 63,
                     .first_seen = 100,
                     .last_seen = 200};
  ASSERT_EQ(block->voxels.size(), 2U);
  EXPECT_EQ(block->voxels[0], ground);
  EXPECT_TRUE(block->voxels[1].is_static);
  EXPECT_FALSE(block->voxels[1].ground);
  EXPECT_EQ(block->voxels[1].mean[2], 'f');
  EXPECT_EQ(block->voxels[1].intensity, 0xff);
}

TEST(BlockFromTheWire, ColumnsOfDifferentLengthAreDataLossNamingTheBlock) {
  v1::VoxelBlock wire = TwoVoxels();
  wire.set_means("abcde");
  EXPECT_TRUE(absl::IsDataLoss(FromWire(wire).status()));
  EXPECT_THAT(ErrorOf(wire), HasSubstr("block (-1, 2, 3) from the server: its columns differ in length"));
}

TEST(BlockFromTheWire, UnsortedOrImpossiblePositionsAreDataLoss) {
  v1::VoxelBlock wire = TwoVoxels();
  wire.set_positions(1, 5);
  EXPECT_THAT(ErrorOf(wire), HasSubstr("not sorted"));
  wire.set_positions(1, 32768);
  EXPECT_THAT(ErrorOf(wire), HasSubstr("not sorted"));
}

TEST(BlockFromTheWire, AnIndexOrCountOutOfRangeIsDataLoss) {
  v1::VoxelBlock wire = TwoVoxels();
  wire.set_hits(0, 65536);
  EXPECT_THAT(ErrorOf(wire), HasSubstr("a count is out of range"));
  wire = TwoVoxels();
  wire.set_z(32768);
  EXPECT_THAT(ErrorOf(wire), HasSubstr("its index is out of range"));
}

TEST(PoseFromTheWire, IsTheOneThatWasSent) {
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  pose.translation() = Eigen::Vector3d(1, 2, 3);
  v1::Pose wire;
  ToWire(pose, &wire);
  const absl::StatusOr<Pose> back = FromWire(wire);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_TRUE(back->isApprox(pose, 1e-14));
  wire.mutable_rows()->RemoveLast();
  EXPECT_TRUE(absl::IsDataLoss(FromWire(wire).status()));
}

}  // namespace
}  // namespace mapkeep
