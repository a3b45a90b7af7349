#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/mapkeep/map_tiles.h"
#include "mapkeep/v1/tile_service.pb.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

/// Tile (1, -1) with one voxel in it, at (5, 6) and height -2.
v1::MapTile OneVoxel() {
  v1::MapTile tile;
  tile.set_map("street");
  tile.mutable_id()->set_x(1);
  tile.mutable_id()->set_y(-1);
  tile.set_version("1-a-0");
  tile.set_voxel_size(0.2);
  tile.set_columns({5, 6});
  tile.add_layers(-2);
  tile.set_means({'\x7f', 0, '\xff'});
  tile.set_normals({0, 0, '\x81'});
  tile.set_stabilities("\xff");
  tile.set_intensities("\x33");
  tile.set_flags("\x01");
  tile.add_masks(1ULL << 63 | 1);
  return tile;
}

std::string Complaint(const v1::MapTile& tile) {
  return std::string(DecodeTile(tile.SerializeAsString()).status().message());
}

TEST(TileCodec, AVoxelIsWhereTheProtoSays) {
  const auto tile = DecodeTile(OneVoxel().SerializeAsString());
  ASSERT_TRUE(tile.ok()) << tile.status();
  ASSERT_EQ(tile->voxels.size(), 1U);
  const TileVoxel& voxel = tile->voxels[0];
  const Eigen::Vector3d corner(0.2 * (128 + 5), 0.2 * (-128 + 6), 0.2 * -2);
  EXPECT_TRUE(voxel.corner.isApprox(corner));
  EXPECT_TRUE(voxel.point.isApprox(corner + 0.2 / 256 * Eigen::Vector3d(127.5, 0.5, 255.5)));
  EXPECT_EQ(voxel.normal, Eigen::Vector3f(0, 0, -1));
  EXPECT_EQ(voxel.stability, 1);
  EXPECT_FLOAT_EQ(voxel.intensity, 0.2F);
  EXPECT_TRUE(voxel.ground);
  const std::vector<Eigen::Vector3d> points = PointsOf(*tile, voxel);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_TRUE(points[0].isApprox(corner + Eigen::Vector3d::Constant(0.025)));
  EXPECT_TRUE(points[1].isApprox(corner + Eigen::Vector3d::Constant(0.175)));
}

TEST(TileCodec, WithoutMasksThePointIsTheMean) {
  v1::MapTile wire = OneVoxel();
  wire.clear_masks();
  const auto tile = DecodeTile(wire.SerializeAsString());
  ASSERT_TRUE(tile.ok()) << tile.status();
  EXPECT_FALSE(tile->has_masks);
  EXPECT_EQ(PointsOf(*tile, tile->voxels[0]), std::vector<Eigen::Vector3d>{tile->voxels[0].point});
}

TEST(TileCodec, DamageIsNamed) {
  EXPECT_THAT(DecodeTile("no tile").status().message(), HasSubstr("no message of a tile"));
  v1::MapTile tile = OneVoxel();
  tile.set_means("ab");
  EXPECT_THAT(Complaint(tile), HasSubstr("tile (1, -1): its columns differ in length"));
  tile = OneVoxel();
  tile.set_columns({5, '\x80'});
  EXPECT_THAT(Complaint(tile), HasSubstr("outside of it"));
  tile = OneVoxel();
  tile.set_layers(0, 1 << 20);
  EXPECT_THAT(Complaint(tile), HasSubstr("outside of the map"));
  tile = OneVoxel();
  tile.mutable_id()->set_y(1 << 20);
  EXPECT_THAT(Complaint(tile), HasSubstr("id is out of range"));
  tile = OneVoxel();
  tile.set_voxel_size(0);
  EXPECT_THAT(Complaint(tile), HasSubstr("voxel size"));
}

}  // namespace
}  // namespace mapkeep
