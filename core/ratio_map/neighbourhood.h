#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

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

/// A value for every voxel of the centre block and of `margin` voxels around it, or of another box of coordinates.
template <typename T>
class ValuesAround {
 public:
  explicit ValuesAround(int margin, const T& value = {})
      : ValuesAround({-margin, -margin, -margin}, {kBlockSize + margin, kBlockSize + margin, kBlockSize + margin},
                     value) {}
  /// From `low` to before `end`.
  ValuesAround(const VoxelIndex& low, const VoxelIndex& end, const T& value = {})
      : low_(low),
        end_(end),
        row_(static_cast<size_t>(end.x - low.x)),
        layer_(row_ * static_cast<size_t>(end.y - low.y)),
        values_(layer_ * static_cast<size_t>(end.z - low.z), value) {}

  bool Has(const VoxelIndex& at) const {
    return at.x >= low_.x && at.x < end_.x && at.y >= low_.y && at.y < end_.y && at.z >= low_.z && at.z < end_.z;
  }
  /// Has(at) must hold.
  T& operator[](const VoxelIndex& at) { return values_[SlotOf(at)]; }
  const T& operator[](const VoxelIndex& at) const { return values_[SlotOf(at)]; }

 private:
  size_t SlotOf(const VoxelIndex& at) const {
    return static_cast<size_t>(at.z - low_.z) * layer_ + static_cast<size_t>(at.y - low_.y) * row_ +
           static_cast<size_t>(at.x - low_.x);
  }

  VoxelIndex low_, end_;
  size_t row_, layer_;
  std::vector<T> values_;
};

/// Calls visit(coordinates) for the (2 reach + 1)^3 voxels around one, itself included.
template <typename Visit>
void ForEachBeside(const VoxelIndex& at, int reach, const Visit& visit) {
  for (int z = at.z - reach; z <= at.z + reach; ++z) {
    for (int y = at.y - reach; y <= at.y + reach; ++y) {
      for (int x = at.x - reach; x <= at.x + reach; ++x) visit(VoxelIndex{x, y, z});
    }
  }
}

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
