#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <array>
#include <compare>
#include <cstdint>

namespace mapkeep {

/// Voxel (or block) coordinates: floor(p / size) an axis, relative to the map's origin.
struct VoxelIndex {
  int32_t x = 0, y = 0, z = 0;
  auto operator<=>(const VoxelIndex&) const = default;
};

inline constexpr int kVoxelBits = 21;                          ///< signed bits of a voxel index an axis
inline constexpr int32_t kVoxelLimit = 1 << (kVoxelBits - 1);  ///< indices lie in [-kVoxelLimit, kVoxelLimit)
inline constexpr int kBlockBits = 5;
inline constexpr int32_t kBlockSize = 1 << kBlockBits;  ///< voxels an axis of a block, the storage unit
inline constexpr int kTileBits = 2;                     ///< a tile, the serving unit, is 4 x 4 block columns

/// The "voxel hash" that keys the store: interleave2(x, y) of the block above its z, each with its sign bit flipped so
/// that keys sort as coordinates do. 48 bits, so that all blocks of a tile are one contiguous key range.
enum class BlockKey : uint64_t {};

/// The leading 28 bits of the block keys of one tile.
enum class TileKey : uint32_t {};

/// Block key, then the position inside the block in 15 bits (x fastest, z slowest). Sorting by it groups a block.
enum class VoxelKey : uint64_t {};

/// floor(p / size), or OUT_OF_RANGE (INVALID_ARGUMENT if p is not finite) if it leaves the 21-bit range.
absl::StatusOr<VoxelIndex> VoxelIndexOf(const Eigen::Vector3d& point, double voxel_size);

/// Whether the index lies in the range that a key can carry.
constexpr bool InRange(const VoxelIndex& v) {
  const auto fits = [](int32_t c) { return c >= -kVoxelLimit && c < kVoxelLimit; };
  return fits(v.x) && fits(v.y) && fits(v.z);
}

/// Coordinates of the block that holds a voxel (arithmetic shift: also right below zero).
constexpr VoxelIndex BlockOf(const VoxelIndex& v) { return {v.x >> kBlockBits, v.y >> kBlockBits, v.z >> kBlockBits}; }

BlockKey BlockKeyOf(const VoxelIndex& block);
VoxelIndex BlockIndexOf(BlockKey key);

/// Position of a voxel inside its block: x + 32 y + 1024 z, each counted from the block's corner.
constexpr uint16_t PositionInBlock(const VoxelIndex& v) {
  constexpr int32_t kMask = kBlockSize - 1;
  return static_cast<uint16_t>((v.x & kMask) | (v.y & kMask) << kBlockBits | (v.z & kMask) << (2 * kBlockBits));
}

VoxelKey VoxelKeyOf(const VoxelIndex& voxel);
VoxelIndex VoxelIndexOf(VoxelKey key);

constexpr BlockKey BlockKeyOf(VoxelKey key) { return BlockKey{static_cast<uint64_t>(key) >> (3 * kBlockBits)}; }
constexpr uint16_t PositionInBlock(VoxelKey key) { return static_cast<uint64_t>(key) & 0x7fff; }
constexpr VoxelKey VoxelKeyOf(BlockKey block, uint16_t position) {
  return VoxelKey{static_cast<uint64_t>(block) << (3 * kBlockBits) | position};
}

constexpr TileKey TileKeyOf(BlockKey key) { return TileKey{static_cast<uint32_t>(static_cast<uint64_t>(key) >> 20)}; }
/// Tile coordinates (z is 0): floor(block / 4) an axis.
VoxelIndex TileIndexOf(TileKey key);
TileKey TileKeyOf(const VoxelIndex& tile);

/// The lowest corner of a voxel or block, in metres relative to the map's origin.
inline Eigen::Vector3d CornerOf(const VoxelIndex& v, double size) { return size * Eigen::Vector3d(v.x, v.y, v.z); }

/// The block and its 26 neighbours, x fastest; the block itself is entry 13. Neighbours outside the range are left out
/// by the caller: test with InRange after scaling.
std::array<VoxelIndex, 27> NeighbourhoodOf(const VoxelIndex& centre);

}  // namespace mapkeep
