#include "core/registration/match_cloud.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

namespace mapkeep {
namespace {

constexpr int kCellBits = 19;  // signed bits of a cell index an axis
constexpr int kLocalBits = 7;  // of the position of a voxel inside its cell: 5^3 = 125
constexpr int64_t kCellLimit = int64_t{1} << (kCellBits - 1);
constexpr size_t kMinNeighbours = 5;
constexpr float kLineShare = 0.02F;  // middle over largest eigenvalue below which the neighbours make a line

uint64_t CellKey(int64_t x, int64_t y, int64_t z) {
  const auto bits = [](int64_t c) { return static_cast<uint64_t>(c + kCellLimit); };
  return bits(z) << (2 * kCellBits) | bits(y) << kCellBits | bits(x);
}

// A voxel's cell, then its place there; all ones for a point that has none.
uint64_t KeyOf(const Eigen::Vector3d& point, double per_voxel) {
  const Eigen::Vector3d scaled = point * per_voxel;
  constexpr double kLimit = static_cast<double>((kCellLimit - 1) * kCellVoxels);
  if (!(scaled.cwiseAbs().maxCoeff() < kLimit) || !scaled.allFinite()) return ~uint64_t{0};
  int64_t cell[3];
  uint64_t local = 0;
  for (int axis = 2; axis >= 0; --axis) {
    const auto voxel = static_cast<int64_t>(std::floor(scaled[axis]));
    cell[axis] = (voxel - (voxel < 0 ? kCellVoxels - 1 : 0)) / kCellVoxels;
    local = local * kCellVoxels + static_cast<uint64_t>(voxel - cell[axis] * kCellVoxels);
  }
  return CellKey(cell[0], cell[1], cell[2]) << kLocalBits | local;
}

// Mean points and unit mean facings (or zero) a voxel, with their cells.
struct ThinnedPoints {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3f> facing;
  std::vector<uint32_t> cell_begin;
  std::vector<uint64_t> cell_keys;
};

void CloseCells(std::span<const uint64_t> keys, std::vector<uint32_t>& cell_begin, std::vector<uint64_t>& cell_keys) {
  for (size_t i = 0; i < keys.size(); ++i) {
    if (cell_keys.empty() || cell_keys.back() != keys[i]) {
      cell_keys.push_back(keys[i]);
      cell_begin.push_back(static_cast<uint32_t>(i));
    }
  }
  cell_begin.push_back(static_cast<uint32_t>(keys.size()));
}

ThinnedPoints Thin(const FacingPoints& input, double voxel_size) {
  std::vector<std::pair<uint64_t, uint32_t>> order(input.points.size());
  tbb::parallel_for(size_t{0}, order.size(), [&](size_t i) {
    order[i] = {KeyOf(input.points[i], 1 / voxel_size), static_cast<uint32_t>(i)};
  });
  std::erase_if(order, [](const auto& entry) { return entry.first == ~uint64_t{0}; });
  tbb::parallel_sort(order);  // pairs differ, so the order is the only one

  ThinnedPoints thinned;
  std::vector<uint64_t> cells;
  for (size_t begin = 0; begin < order.size();) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    Eigen::Vector3d facing = Eigen::Vector3d::Zero();
    size_t end = begin;
    for (; end < order.size() && order[end].first == order[begin].first; ++end) {
      const uint32_t i = order[end].second;
      sum += input.points[i];
      const double length = input.facing[i].norm();
      if (std::isfinite(length) && length > 0) facing += input.facing[i] / length;
    }
    thinned.points.emplace_back(sum / static_cast<double>(end - begin));
    const double length = facing.norm();
    thinned.facing.emplace_back(Eigen::Vector3f::Zero());
    if (length > 0) thinned.facing.back() = (facing / length).cast<float>();
    cells.push_back(order[begin].first >> kLocalBits);
    begin = end;
  }
  CloseCells(cells, thinned.cell_begin, thinned.cell_keys);
  return thinned;
}

// The unit normal of the plane through offsets from a point, towards `facing`; zero if there is none.
Eigen::Vector3f OrientedNormal(std::span<const Eigen::Vector3f> offsets, const Eigen::Vector3f& facing) {
  if (offsets.size() < kMinNeighbours) return Eigen::Vector3f::Zero();
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  Eigen::Matrix3f squares = Eigen::Matrix3f::Zero();
  for (const Eigen::Vector3f& offset : offsets) {
    sum += offset;
    squares += offset * offset.transpose();
  }
  const auto count = static_cast<float>(offsets.size());
  const Eigen::Matrix3f covariance = squares / count - (sum / count) * (sum / count).transpose();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
  solver.computeDirect(covariance);
  if (!(solver.eigenvalues()[1] > kLineShare * solver.eigenvalues()[2])) return Eigen::Vector3f::Zero();
  const Eigen::Vector3f normal = solver.eigenvectors().col(0).normalized();
  const float side = normal.dot(facing);
  if (!normal.allFinite() || !std::isfinite(side) || side == 0) return Eigen::Vector3f::Zero();
  return side > 0 ? normal : Eigen::Vector3f(-normal);
}

// A normal is turned to the side that its neighbours face together: at grazing angles a point alone often errs.
void NormalsOfCell(const ThinnedPoints& cloud, size_t cell, float radius, std::vector<Eigen::Vector3f>& normals) {
  std::vector<PointRange> ranges;
  NeighbouringRanges(cloud.cell_keys, cloud.cell_begin, cell, ranges);
  const Eigen::Vector3d origin = cloud.points[cloud.cell_begin[cell]];
  std::vector<Eigen::Vector3f> candidates;
  std::vector<Eigen::Vector3f> facings;
  for (const PointRange& range : ranges) {
    for (uint32_t i = range.begin; i < range.end; ++i) {
      candidates.emplace_back((cloud.points[i] - origin).cast<float>());
      facings.push_back(cloud.facing[i]);
    }
  }
  std::vector<Eigen::Vector3f> offsets;
  for (uint32_t i = cloud.cell_begin[cell]; i < cloud.cell_begin[cell + 1]; ++i) {
    const Eigen::Vector3f point = (cloud.points[i] - origin).cast<float>();
    Eigen::Vector3f facing = Eigen::Vector3f::Zero();
    offsets.clear();
    for (size_t k = 0; k < candidates.size(); ++k) {
      const Eigen::Vector3f offset = candidates[k] - point;
      if (!(offset.squaredNorm() < radius * radius)) continue;
      offsets.push_back(offset);
      facing += facings[k];
    }
    normals[i] = OrientedNormal(offsets, facing);
  }
}

}  // namespace

void NeighbouringRanges(std::span<const uint64_t> cell_keys, std::span<const uint32_t> cell_begin, size_t cell,
                        std::vector<PointRange>& ranges) {
  ranges.clear();
  for (int64_t z = -1; z <= 1; ++z) {
    for (int64_t y = -1; y <= 1; ++y) {
      // x is the lowest part of a key, so three cells along x follow each other. The limit on points leaves one cell
      // free at each end.
      const uint64_t middle = cell_keys[cell] + static_cast<uint64_t>((z * (int64_t{1} << (2 * kCellBits))) +
                                                                      (y * (int64_t{1} << kCellBits)));
      const auto first = std::lower_bound(cell_keys.begin(), cell_keys.end(), middle - 1);
      auto last = first;
      while (last != cell_keys.end() && *last <= middle + 1) ++last;
      if (first != last)
        ranges.push_back({cell_begin[first - cell_keys.begin()], cell_begin[last - cell_keys.begin()]});
    }
  }
}

MatchCloud MakeMatchCloud(const FacingPoints& input, double voxel_size, double normal_radius) {
  const ThinnedPoints thinned = Thin(input, voxel_size);
  std::vector<Eigen::Vector3f> normals(thinned.points.size());
  const auto radius = static_cast<float>(std::min<double>(normal_radius, kCellVoxels) * voxel_size);
  tbb::parallel_for(size_t{0}, thinned.cell_keys.size(),
                    [&](size_t cell) { NormalsOfCell(thinned, cell, radius, normals); });

  MatchCloud cloud{.voxel_size = voxel_size};
  std::vector<uint64_t> cells;
  for (size_t cell = 0; cell < thinned.cell_keys.size(); ++cell) {
    for (uint32_t i = thinned.cell_begin[cell]; i < thinned.cell_begin[cell + 1]; ++i) {
      if (normals[i].isZero()) continue;
      cloud.points.push_back(thinned.points[i]);
      cloud.normals.push_back(normals[i]);
      cells.push_back(thinned.cell_keys[cell]);
    }
  }
  CloseCells(cells, cloud.cell_begin, cloud.cell_keys);
  return cloud;
}

}  // namespace mapkeep
