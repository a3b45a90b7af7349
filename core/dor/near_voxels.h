#pragma once

#include <bit>
#include <cmath>

#include "core/voxels/voxel_grid.h"

namespace mapkeep {

/// A coarse answer to whether any of a set of voxels is near: one lies in the same cell of the given edge, or in one of
/// the 26 around.
class NearVoxels {
 public:
  /// `edge` in voxel edges.
  explicit NearVoxels(double edge) : edge_(edge) {}

  /// Not after Finish.
  void Insert(const VoxelIndex& voxel) { cells_.Insert(CellOf(voxel)); }

  /// Many are asked about for one that was inserted, so the cells around are filled here.
  void Finish() {
    for (size_t brick = 0; brick < cells_.brick_count(); ++brick) {
      const VoxelIndex corner = cells_.CornerOfBrick(static_cast<int32_t>(brick));
      const BrickBits& bits = cells_.bits(static_cast<int32_t>(brick));
      for (int z = 0; z < kBrickSize; ++z) {
        for (uint64_t rest = bits[z]; rest != 0; rest &= rest - 1) {
          const int bit = std::countr_zero(rest);
          const VoxelIndex cell{corner.x + (bit & 7), corner.y + (bit >> 3), corner.z + z};
          for (int i = 0; i < 27; ++i) around_.Insert({cell.x + i % 3 - 1, cell.y + i / 3 % 3 - 1, cell.z + i / 9 - 1});
        }
      }
    }
    around_.Finish();
  }

  /// After Finish; from several threads at once.
  bool AnyNear(const VoxelIndex& voxel) const { return around_.Find(CellOf(voxel)) != kNoVoxel; }

 private:
  VoxelIndex CellOf(const VoxelIndex& voxel) const {
    const auto at = [&](int32_t c) { return static_cast<int32_t>(std::floor(c / edge_)); };
    return {at(voxel.x), at(voxel.y), at(voxel.z)};
  }

  double edge_;
  VoxelGrid cells_, around_;
};

}  // namespace mapkeep
