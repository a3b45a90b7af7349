#include "server/rpc/tile_message.h"

#include <absl/strings/str_format.h>

#include <cmath>
#include <utility>

#include "core/voxels/normal.h"
#include "server/rpc/convert.h"

namespace mapkeep {
namespace {

// Another one if the same voxels make another message: what clients hold is then out of date.
constexpr int kMessageVersion = 1;
constexpr int32_t kTileVoxels = kBlockSize << kTileBits;  // along an edge

/// Everything but the columns.
v1::MapTile WithoutVoxels(const Snapshot& snapshot, const TileEntry& entry) {
  const MapRecord& map = snapshot.map();
  const VoxelIndex index = TileIndexOf(entry.key);
  v1::MapTile tile;
  tile.set_map(map.name);
  tile.mutable_id()->set_x(index.x);
  tile.mutable_id()->set_y(index.y);
  tile.set_version(VersionOf(entry));
  tile.set_voxel_size(map.voxel_size);
  if (map.origin) *tile.mutable_origin() = ToProto(*map.origin);
  tile.set_crs(map.crs);
  return tile;
}

char ByteOf(double share) { return static_cast<char>(static_cast<uint8_t>(std::lround(255 * share))); }

/// The columns of a tile under construction.
struct Columns {
  std::string columns, means, normals, stabilities, intensities, flags;
};

void Append(const VoxelIndex& index, const Voxel& voxel, double eta, Columns& columns, v1::MapTile& tile) {
  columns.columns.push_back(static_cast<char>(index.x & (kTileVoxels - 1)));
  columns.columns.push_back(static_cast<char>(index.y & (kTileVoxels - 1)));
  tile.add_layers(index.z);
  columns.means.append(voxel.mean.begin(), voxel.mean.end());
  const Eigen::Vector3d normal = DecodeNormal(voxel.normal);
  for (int axis = 0; axis < 3; ++axis) columns.normals.push_back(static_cast<char>(std::lround(127 * normal[axis])));
  columns.stabilities.push_back(ByteOf(Stability(voxel.hits, voxel.exposures, kCountScale * eta)));
  columns.intensities.push_back(static_cast<char>(voxel.intensity));
  columns.flags.push_back(static_cast<char>(voxel.ground ? 1 : 0));
}

/// Bytes of a field of `length` bytes: its tag (all numbers are below 16), its length, and itself.
uint64_t FieldBytes(uint64_t length) {
  uint64_t bytes = 2 + length;
  for (uint64_t rest = length >> 7; rest > 0; rest >>= 7) ++bytes;
  return bytes;
}

}  // namespace

std::string VersionOf(const TileEntry& entry) {
  return absl::StrFormat("%d-%016x-%x", kMessageVersion, entry.version.attempt, entry.version.round);
}

absl::StatusOr<v1::MapTile> MakeTile(const Snapshot& snapshot, const TileEntry& entry, v1::TileDetail detail,
                                     double eta) {
  v1::MapTile tile = WithoutVoxels(snapshot, entry);
  const absl::StatusOr<std::vector<std::shared_ptr<const Block>>> blocks = snapshot.ReadTile(entry.key);
  if (!blocks.ok()) return blocks.status();
  const auto voxels = static_cast<int>(entry.totals.static_voxels);
  tile.mutable_layers()->Reserve(voxels);
  if (detail == v1::TILE_DETAIL_SUB_VOXELS) tile.mutable_masks()->Reserve(voxels);
  Columns columns;
  for (const std::shared_ptr<const Block>& block : *blocks) {
    for (const Voxel& voxel : block->voxels) {
      if (!voxel.is_static) continue;
      Append(VoxelIndexOf(VoxelKeyOf(block->key, voxel.position)), voxel, eta, columns, tile);
      if (detail == v1::TILE_DETAIL_SUB_VOXELS) tile.add_masks(voxel.mask);
    }
  }
  tile.set_columns(std::move(columns.columns));
  tile.set_means(std::move(columns.means));
  tile.set_normals(std::move(columns.normals));
  tile.set_stabilities(std::move(columns.stabilities));
  tile.set_intensities(std::move(columns.intensities));
  tile.set_flags(std::move(columns.flags));
  return tile;
}

v1::TileInfo DescribeTile(const Snapshot& snapshot, const TileEntry& entry, v1::TileDetail detail) {
  const v1::MapTile tile = WithoutVoxels(snapshot, entry);
  const uint64_t voxels = entry.totals.static_voxels;
  uint64_t bytes = tile.ByteSizeLong();
  // columns, layers, means, normals; stabilities, intensities, flags
  for (const uint64_t width : {2, 4, 3, 3, 1, 1, 1}) bytes += FieldBytes(width * voxels);
  if (detail == v1::TILE_DETAIL_SUB_VOXELS) bytes += FieldBytes(8 * voxels);
  v1::TileInfo info;
  *info.mutable_id() = tile.id();
  info.set_version(tile.version());
  info.set_bytes(bytes);
  info.set_voxels(voxels);
  return info;
}

}  // namespace mapkeep
