#include "client/picture/top_view.h"

#include <algorithm>
#include <cmath>

namespace mapkeep {

TopView MakeTopView(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double cell_size) {
  TopView view{.cell_size = cell_size, .corner = low};
  view.width = static_cast<int>(std::ceil((high.x() - low.x()) / cell_size));
  view.height = static_cast<int>(std::ceil((high.y() - low.y()) / cell_size));
  view.cells.resize(static_cast<size_t>(view.width) * view.height);
  return view;
}

void AddBlock(const Block& block, double voxel_size, TopView& view) {
  constexpr double kEta = 1e-3 * kCountScale;
  // A sub-voxel covers every cell that its square touches, so that a fine picture has no holes.
  const double half = voxel_size / 8;
  for (const Voxel& voxel : block.voxels) {
    if (!voxel.is_static) continue;
    const auto stability = static_cast<float>(Stability(voxel.hits, voxel.exposures, kEta));
    for (const Eigen::Vector3d& point : SubVoxelPoints(block, voxel, voxel_size)) {
      const auto cell_of = [&](double coordinate, int axis) {
        return static_cast<int>(std::floor((coordinate - view.corner[axis]) / view.cell_size));
      };
      const int left = std::max(0, cell_of(point.x() - half, 0));
      const int right = std::min(view.width - 1, cell_of(point.x() + half - 1e-9, 0));
      const int bottom = std::max(0, cell_of(point.y() - half, 1));
      const int top = std::min(view.height - 1, cell_of(point.y() + half - 1e-9, 1));
      for (int row = bottom; row <= top; ++row) {
        for (int column = left; column <= right; ++column) {
          TopView::Cell& cell = view.cells[static_cast<size_t>(row) * view.width + column];
          if (cell.occupied && cell.z >= point.z()) continue;
          cell = {.z = static_cast<float>(point.z()),
                  .stability = stability,
                  .last_seen = voxel.last_seen,
                  .ground = voxel.ground,
                  .occupied = true};
        }
      }
    }
  }
}

TopView Cropped(const TopView& view, int margin) {
  int left = view.width, right = -1, bottom = view.height, top = -1;
  for (int row = 0; row < view.height; ++row) {
    for (int column = 0; column < view.width; ++column) {
      if (!view.At(column, row).occupied) continue;
      left = std::min(left, column), right = std::max(right, column);
      bottom = std::min(bottom, row), top = std::max(top, row);
    }
  }
  TopView cropped{.cell_size = view.cell_size};
  if (right < 0) return cropped;
  left = std::max(0, left - margin), right = std::min(view.width - 1, right + margin);
  bottom = std::max(0, bottom - margin), top = std::min(view.height - 1, top + margin);
  cropped.corner = view.corner + view.cell_size * Eigen::Vector2d(left, bottom);
  cropped.width = right - left + 1, cropped.height = top - bottom + 1;
  cropped.cells.reserve(static_cast<size_t>(cropped.width) * cropped.height);
  for (int row = bottom; row <= top; ++row) {
    const auto begin = view.cells.begin() + static_cast<std::ptrdiff_t>(row) * view.width;
    cropped.cells.insert(cropped.cells.end(), begin + left, begin + right + 1);
  }
  return cropped;
}

}  // namespace mapkeep
