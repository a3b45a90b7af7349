#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/dor/exposure.h"
#include "core/voxels/voxel_grid.h"

namespace mapkeep {

/// The evidence about a place, summed over the voxels that were hit there.
struct EvidenceAround {
  uint64_t voxels = 0, voids = 0;  ///< and those of them that were ever confirmed as voids
  uint64_t hits = 0, exposures = 0;
  uint64_t unsteady_hits = 0, unsteady_returns = 0;  ///< of the voxels with more than a few exposures a hit

  double void_share() const { return ShareOf(voids, voxels); }
  double stability() const { return ShareOf(hits, hits + exposures); }
  double return_share() const { return ShareOf(unsteady_returns, unsteady_hits); }

  void Add(const EvidenceAround& other) {
    voxels += other.voxels;
    voids += other.voids;
    hits += other.hits;
    exposures += other.exposures;
    unsteady_hits += other.unsteady_hits;
    unsteady_returns += other.unsteady_returns;
  }

 private:
  static double ShareOf(uint64_t part, uint64_t whole) {
    return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
  }
};

/// Answers what the evidence about the surroundings of a voxel is, by cells of about 0.2 m: sums over the voxels of a
/// cell, or the voxels themselves where they are not smaller.
class Surroundings {
 public:
  /// Of the voxels of the grid for which `is_part` says so. `unsteady_below`: R below which a voxel is unsteady. Grid
  /// and counts outlive this.
  Surroundings(const VoxelGrid& grid, const VoxelCounts& counts, double voxel_size, double unsteady_below,
               std::function<bool(uint32_t id)> is_part);

  /// Within two cells to every side of the voxel's. From several threads at once.
  EvidenceAround Around(const VoxelIndex& voxel) const;

 private:
  VoxelIndex CellOf(const VoxelIndex& voxel) const;
  void SumCells();

  const VoxelGrid& grid_;
  const VoxelCounts& counts_;
  double unsteady_below_;
  std::function<bool(uint32_t id)> is_part_;
  int edge_;                          // of a cell, in voxel edges; at 1 there are no other cells than the voxels
  VoxelGrid cells_;                   // else
  std::vector<EvidenceAround> sums_;  // by id of the cell
};

}  // namespace mapkeep
