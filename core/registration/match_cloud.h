#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace mapkeep {

/// What the global matcher is given: points of surfaces, and for each a direction into the free space in front of it:
/// from the point towards the sensor that saw it, or the map's stored normal. Any length; zero where unknown. Columns
/// of equal length.
struct FacingPoints {
  std::vector<Eigen::Vector3d> points;  ///< metres, any frame
  std::vector<Eigen::Vector3d> facing;
};

/// One mean point a voxel with an oriented normal, in the order of the cells of `kCellVoxels` voxels that hold them, so
/// that the neighbours of a point lie in few contiguous ranges. Columns of equal length; all values are finite.
struct MatchCloud {
  double voxel_size = 0;                 ///< v, metres
  std::vector<Eigen::Vector3d> points;   ///< as given
  std::vector<Eigen::Vector3f> normals;  ///< unit, towards the free side
  std::vector<uint32_t> cell_begin;      ///< first point of each cell, and one past the last point
  std::vector<uint64_t> cell_keys;       ///< one a cell, ascending
};

/// Edge of a cell in voxels: the radius of the descriptor, so that a neighbourhood is a cell and its 26 neighbours.
inline constexpr int kCellVoxels = 5;

/// Thins points to one a voxel and gives each the normal of the plane through its neighbours within `normal_radius`
/// voxels (at most kCellVoxels), turned to the side that the points face. Left out: points that are not finite or
/// more than 2^18 cells from the origin, and those whose neighbours are too few, make a line, or whose side is
/// unknown. Parallel on the calling oneTBB arena; the same on any number of threads.
MatchCloud MakeMatchCloud(const FacingPoints& input, double voxel_size, double normal_radius);

/// The cells of a cloud that may hold neighbours of the points of cell `cell` (itself included), as ranges of points.
struct PointRange {
  uint32_t begin = 0, end = 0;
};
void NeighbouringRanges(std::span<const uint64_t> cell_keys, std::span<const uint32_t> cell_begin, size_t cell,
                        std::vector<PointRange>& ranges);

}  // namespace mapkeep
