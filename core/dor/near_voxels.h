#pragma once

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
  void Finish() { cells_.Finish(); }

  /// After Finish; from several threads at once.
  bool AnyNear(const VoxelIndex& voxel) const {
    const VoxelIndex cell = CellOf(voxel);
    for (int i = 0; i < 27; ++i) {
      if (cells_.Find({cell.x + i % 3 - 1, cell.y + i / 3 % 3 - 1, cell.z + i / 9 - 1}) != kNoVoxel) return true;
    }
    return false;
  }

 private:
  VoxelIndex CellOf(const VoxelIndex& voxel) const {
    const auto at = [&](int32_t c) { return static_cast<int32_t>(std::floor(c / edge_)); };
    return {at(voxel.x), at(voxel.y), at(voxel.z)};
  }

  double edge_;
  VoxelGrid cells_;
};

}  // namespace mapkeep
