#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/voxels/block.h"

namespace mapkeep {

/// The map from above: for each cell the highest static point. Row 0 is the southernmost (lowest y).
struct TopView {
  double cell_size = 0;                              ///< metres
  Eigen::Vector2d corner = Eigen::Vector2d::Zero();  ///< lowest x and y, metres relative to the map's origin
  int width = 0, height = 0;                         ///< cells

  struct Cell {
    float z = 0;             ///< metres
    float stability = 0;     ///< R of eq. 4
    uint32_t last_seen = 0;  ///< minutes since 2000-01-01 UTC
    bool ground = false;
    bool occupied = false;
  };
  std::vector<Cell> cells;  ///< width * height, row by row

  const Cell& At(int column, int row) const { return cells[static_cast<size_t>(row) * width + column]; }
};

/// An empty view that covers [low, high), both in metres.
TopView MakeTopView(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double cell_size);

/// Draws the static voxels of a block, each as its sub-voxel points.
void AddBlock(const Block& block, double voxel_size, TopView& view);

/// The part of the view that has something in it, with a margin in cells; no cells if there is nothing.
TopView Cropped(const TopView& view, int margin);

}  // namespace mapkeep
