#include <absl/status/status.h>
#include <absl/strings/str_format.h>

#include <bit>
#include <cmath>
#include <utility>

#include "client/mapkeep/map_tiles.h"
#include "core/voxels/voxel_index.h"
#include "mapkeep/v1/tile_service.pb.h"

namespace mapkeep {
namespace {

constexpr int32_t kTileVoxels = kBlockSize << kTileBits;

/// Why the message cannot be a tile, or nothing.
std::string_view Flaw(const v1::MapTile& wire) {
  constexpr int32_t kLimit = kVoxelLimit / kTileVoxels;
  for (const int32_t c : {wire.id().x(), wire.id().y()}) {
    if (c < -kLimit || c >= kLimit) return "its id is out of range";
  }
  if (!std::isfinite(wire.voxel_size()) || wire.voxel_size() <= 0) return "its voxel size makes no sense";
  const size_t count = wire.layers_size();
  const bool fits = wire.columns().size() == 2 * count && wire.means().size() == 3 * count &&
                    wire.normals().size() == 3 * count && wire.stabilities().size() == count &&
                    wire.intensities().size() == count && wire.flags().size() == count &&
                    (wire.masks().empty() || wire.masks_size() == wire.layers_size());
  if (!fits) return "its columns differ in length";
  for (const char column : wire.columns()) {
    if (static_cast<uint8_t>(column) >= kTileVoxels) return "a voxel lies outside of it";
  }
  for (const int32_t layer : wire.layers()) {
    if (layer < -kVoxelLimit || layer >= kVoxelLimit) return "a voxel lies outside of the map";
  }
  return "";
}

TileVoxel VoxelAt(const v1::MapTile& wire, int n) {
  const auto byte = [n](const std::string& column, int width, int at) {
    return static_cast<uint8_t>(column[static_cast<size_t>(width) * n + at]);
  };
  const Eigen::Vector3d index(kTileVoxels * wire.id().x() + byte(wire.columns(), 2, 0),
                              kTileVoxels * wire.id().y() + byte(wire.columns(), 2, 1), wire.layers(n));
  TileVoxel voxel;
  voxel.corner = wire.voxel_size() * index;
  for (int axis = 0; axis < 3; ++axis) {
    voxel.point[axis] = (index[axis] + (byte(wire.means(), 3, axis) + 0.5) / 256) * wire.voxel_size();
    voxel.normal[axis] = static_cast<float>(static_cast<int8_t>(byte(wire.normals(), 3, axis))) / 127.F;
  }
  voxel.stability = static_cast<float>(byte(wire.stabilities(), 1, 0)) / 255.F;
  voxel.intensity = static_cast<float>(byte(wire.intensities(), 1, 0)) / 255.F;
  voxel.ground = (byte(wire.flags(), 1, 0) & 1) != 0;
  if (!wire.masks().empty()) voxel.mask = wire.masks(n);
  return voxel;
}

}  // namespace

absl::StatusOr<MapTile> DecodeTile(std::string_view bytes) {
  v1::MapTile wire;
  if (!wire.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return absl::DataLossError("a tile: it is no message of a tile");
  }
  if (const std::string_view flaw = Flaw(wire); !flaw.empty()) {
    return absl::DataLossError(absl::StrFormat("tile (%d, %d): %s", wire.id().x(), wire.id().y(), flaw));
  }
  MapTile tile{.map = wire.map(),
               .id = {wire.id().x(), wire.id().y()},
               .version = wire.version(),
               .voxel_size = wire.voxel_size(),
               .origin = {},
               .crs = wire.crs(),
               .has_masks = !wire.masks().empty(),
               .voxels = {}};
  if (wire.has_origin()) tile.origin = Eigen::Vector3d(wire.origin().x(), wire.origin().y(), wire.origin().z());
  tile.voxels.reserve(wire.layers_size());
  for (int n = 0; n < wire.layers_size(); ++n) tile.voxels.push_back(VoxelAt(wire, n));
  return tile;
}

std::vector<Eigen::Vector3d> PointsOf(const MapTile& tile, const TileVoxel& voxel) {
  if (voxel.mask == 0) return {voxel.point};
  std::vector<Eigen::Vector3d> points;
  for (uint64_t left = voxel.mask; left != 0; left &= left - 1) {
    const int bit = std::countr_zero(left);
    const Eigen::Vector3d quarter(bit & 3, (bit >> 2) & 3, bit >> 4);
    points.emplace_back(voxel.corner + (quarter.array() + 0.5).matrix() / 4 * tile.voxel_size);
  }
  return points;
}

}  // namespace mapkeep
