#include "core/voxels/voxel_index.h"

#include <absl/strings/str_format.h>

#include <cmath>

namespace mapkeep {
namespace {

constexpr int kBlockAxisBits = kVoxelBits - kBlockBits;  // 16
constexpr int32_t kBlockBias = 1 << (kBlockAxisBits - 1);

uint64_t SpreadBits(uint32_t value) {
  uint64_t v = value;
  v = (v | v << 8) & 0x00ff00ffU;
  v = (v | v << 4) & 0x0f0f0f0fU;
  v = (v | v << 2) & 0x33333333U;
  return (v | v << 1) & 0x55555555U;
}

uint32_t GatherBits(uint64_t value) {
  uint64_t v = value & 0x55555555U;
  v = (v | v >> 1) & 0x33333333U;
  v = (v | v >> 2) & 0x0f0f0f0fU;
  v = (v | v >> 4) & 0x00ff00ffU;
  return static_cast<uint32_t>((v | v >> 8) & 0xffffU);
}

uint32_t Biased(int32_t block_coordinate) { return static_cast<uint32_t>(block_coordinate + kBlockBias) & 0xffffU; }

}  // namespace

absl::StatusOr<VoxelIndex> VoxelIndexOf(const Eigen::Vector3d& point, double voxel_size) {
  if (!point.allFinite()) return absl::InvalidArgumentError("the point is not finite");
  const Eigen::Vector3d cell = (point / voxel_size).array().floor();
  if ((cell.array() < -kVoxelLimit).any() || (cell.array() >= kVoxelLimit).any()) {
    return absl::OutOfRangeError(
        absl::StrFormat("point (%.1f, %.1f, %.1f) m lies beyond the map's range of +-%.1f m about its origin",
                        point.x(), point.y(), point.z(), kVoxelLimit * voxel_size));
  }
  return VoxelIndex{static_cast<int32_t>(cell.x()), static_cast<int32_t>(cell.y()), static_cast<int32_t>(cell.z())};
}

BlockKey BlockKeyOf(const VoxelIndex& block) {
  const uint64_t column = SpreadBits(Biased(block.x)) | SpreadBits(Biased(block.y)) << 1;
  return BlockKey{column << kBlockAxisBits | Biased(block.z)};
}

VoxelIndex BlockIndexOf(BlockKey key) {
  const auto bits = static_cast<uint64_t>(key);
  const uint64_t column = bits >> kBlockAxisBits;
  return {static_cast<int32_t>(GatherBits(column)) - kBlockBias,
          static_cast<int32_t>(GatherBits(column >> 1)) - kBlockBias,
          static_cast<int32_t>(bits & 0xffffU) - kBlockBias};
}

VoxelKey VoxelKeyOf(const VoxelIndex& voxel) { return VoxelKeyOf(BlockKeyOf(BlockOf(voxel)), PositionInBlock(voxel)); }

VoxelIndex VoxelIndexOf(VoxelKey key) {
  const VoxelIndex block = BlockIndexOf(BlockKeyOf(key));
  const int position = PositionInBlock(key);
  constexpr int kMask = kBlockSize - 1;
  return {block.x * kBlockSize + (position & kMask), block.y * kBlockSize + (position >> kBlockBits & kMask),
          block.z * kBlockSize + (position >> (2 * kBlockBits))};
}

VoxelIndex TileIndexOf(TileKey key) {
  const uint64_t column = static_cast<uint64_t>(key) << (2 * kTileBits);
  const VoxelIndex block = BlockIndexOf(BlockKey{column << kBlockAxisBits});
  return {block.x >> kTileBits, block.y >> kTileBits, 0};
}

TileKey TileKeyOf(const VoxelIndex& tile) {
  return TileKeyOf(BlockKeyOf(VoxelIndex{tile.x << kTileBits, tile.y << kTileBits, 0}));
}

std::array<VoxelIndex, 27> NeighbourhoodOf(const VoxelIndex& centre) {
  std::array<VoxelIndex, 27> neighbours;
  for (int i = 0; i < 27; ++i) neighbours[i] = {centre.x + i % 3 - 1, centre.y + i / 3 % 3 - 1, centre.z + i / 9 - 1};
  return neighbours;
}

}  // namespace mapkeep
