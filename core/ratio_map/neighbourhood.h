#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "core/voxels/block.h"

namespace mapkeep {

// Coordinates of the voxels of a block and its 26 neighbours: from the centre block's corner, in voxels.

inline constexpr int kCentre = 13;  ///< the block itself, in the order of NeighbourhoodOf

/// Where a position lies in its block.
constexpr VoxelIndex IndexIn(uint16_t position) {
  constexpr int kMask = kBlockSize - 1;
  return {position & kMask, position >> kBlockBits & kMask, position >> (2 * kBlockBits)};
}

/// Where a position lies in the neighbourhood's `i`th block.
constexpr VoxelIndex IndexIn(uint16_t position, int i) {
  const VoxelIndex in = IndexIn(position);
  return {in.x + (i % 3 - 1) * kBlockSize, in.y + (i / 3 % 3 - 1) * kBlockSize, in.z + (i / 9 - 1) * kBlockSize};
}

/// Whether a coordinate lies in the centre block, or at most `margin` voxels outside.
constexpr bool IsWithin(int32_t c, int margin) { return c >= -margin && c < kBlockSize + margin; }

/// The voxels of a block, which are sorted by position, in layers [first, last) of z.
inline std::span<const Voxel> Layers(const Block& block, int first, int last) {
  if (first <= 0 && last >= kBlockSize) return block.voxels;
  const auto before = [](int layer) {
    return
        [position = std::max(layer, 0) << (2 * kBlockBits)](const Voxel& voxel) { return voxel.position < position; };
  };
  const auto begin = std::ranges::partition_point(block.voxels, before(first));
  return {begin, std::ranges::partition_point(begin, block.voxels.end(), before(last))};
}

/// Calls visit(voxel, coordinates, whether it is the centre block's) for every voxel of the neighbourhood that lies at
/// most `margin` voxels outside the centre block, in a fixed order.
template <typename Visit>
void ForEachWithin(const BlockNeighbourhood& blocks, int margin, const Visit& visit) {
  for (int i = 0; i < 27; ++i) {
    if (blocks[i] == nullptr) continue;
    const int corner = (i / 9 - 1) * kBlockSize;
    for (const Voxel& voxel : Layers(*blocks[i], -margin - corner, kBlockSize + margin - corner)) {
      const VoxelIndex at = IndexIn(voxel.position, i);
      if (IsWithin(at.x, margin) && IsWithin(at.y, margin)) visit(voxel, at, i == kCentre);
    }
  }
}

}  // namespace mapkeep
