#include "core/dor/pose_refinement.h"

#include <absl/container/flat_hash_map.h>
#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

namespace mapkeep {
namespace {

constexpr int kIterations = 4;         // Gauss-Newton steps a scan and round
constexpr int kSteps = 512;            // of a cell's edge, in which positions are summed
constexpr int64_t kMinPoints = 12;     // that make a plane
constexpr double kMaxThickness = 0.1;  // metres, standard deviation off a plane
constexpr double kMaxFlatness = 0.1;   // smallest eigenvalue by the middle one
// Weight of the pose as given, in points a point that was matched: the planes of noisy level ground lean a little this
// way and that, which must not move a scan along it.
constexpr double kPrior = 0.003;
constexpr size_t kMinMatches = 100;
constexpr double kFineDistance = 0.01;  // metres: a mean distance from planes below this is taken for this

using Key = uint64_t;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Cell = std::array<int64_t, 3>;

// A grid of cells. Surfaces that lie on the border of two cells, as level ground at z = 0 may, make no good plane in
// either: so every round shifts the grid.
struct CellGrid {
  double edge = 0;   // metres
  double shift = 0;  // edges

  Eigen::Vector3d At(const Eigen::Vector3d& point) const { return (point / edge).array() + shift; }
};

constexpr double kMeasuringShift = 0.25;
double ShiftOf(int round) { return round % 2 == 0 ? 0 : 0.5; }

Cell CellOf(const Eigen::Vector3d& at) {
  return {static_cast<int64_t>(std::floor(at.x())), static_cast<int64_t>(std::floor(at.y())),
          static_cast<int64_t>(std::floor(at.z()))};
}

Key KeyOf(const Cell& cell) {
  constexpr uint64_t kMask = (uint64_t{1} << 21) - 1;
  return (static_cast<uint64_t>(cell[0]) & kMask) | (static_cast<uint64_t>(cell[1]) & kMask) << 21 |
         (static_cast<uint64_t>(cell[2]) & kMask) << 42;
}

// Sums over the points of a cell, in steps from its lowest corner.
struct Sums {
  Cell cell{};
  int64_t count = 0;
  std::array<int64_t, 3> first{};
  std::array<int64_t, 6> second{};  // xx xy xz yy yz zz

  void Add(const std::array<int64_t, 3>& p) {
    ++count;
    for (int i = 0; i < 3; ++i) first[i] += p[i];
    second[0] += p[0] * p[0];
    second[1] += p[0] * p[1];
    second[2] += p[0] * p[2];
    second[3] += p[1] * p[1];
    second[4] += p[1] * p[2];
    second[5] += p[2] * p[2];
  }

  void Add(const Sums& other) {
    cell = other.cell;
    count += other.count;
    for (int i = 0; i < 3; ++i) first[i] += other.first[i];
    for (int i = 0; i < 6; ++i) second[i] += other.second[i];
  }
};

using SumsByCell = absl::flat_hash_map<Key, Sums>;

struct Plane {
  Eigen::Vector3d mean;
  Eigen::Vector3d normal;
};

using Planes = absl::flat_hash_map<Key, Plane>;

SumsByCell SumUp(const std::vector<std::vector<Eigen::Vector3f>>& scans, std::span<const Pose> poses,
                 const CellGrid& grid) {
  tbb::enumerable_thread_specific<SumsByCell> parts;
  tbb::parallel_for(size_t{0}, scans.size(), [&](size_t i) {
    SumsByCell& part = parts.local();
    for (const Eigen::Vector3f& point : scans[i]) {
      const Eigen::Vector3d at = grid.At(poses[i] * point.cast<double>());
      const Cell cell = CellOf(at);
      Sums& sums = part[KeyOf(cell)];
      sums.cell = cell;
      std::array<int64_t, 3> steps;
      for (int axis = 0; axis < 3; ++axis) {
        steps[axis] = static_cast<int64_t>((at[axis] - static_cast<double>(cell[axis])) * kSteps);
      }
      sums.Add(steps);
    }
  });
  SumsByCell all;
  for (const SumsByCell& part : parts) {
    for (const auto& [key, sums] : part) all[key].Add(sums);
  }
  return all;
}

Planes PlanesOf(const SumsByCell& cells, const CellGrid& grid) {
  std::vector<std::pair<Key, Plane>> found(cells.size());
  std::vector<const std::pair<const Key, Sums>*> entries;
  entries.reserve(cells.size());
  for (const auto& entry : cells) entries.push_back(&entry);
  std::vector<char> is_plane(cells.size());
  tbb::parallel_for(tbb::blocked_range<size_t>(0, entries.size(), 256), [&](const auto& range) {
    for (size_t i = range.begin(); i != range.end(); ++i) {
      const Sums& sums = entries[i]->second;
      if (sums.count < kMinPoints) continue;
      const double n = static_cast<double>(sums.count), step = grid.edge / kSteps;
      const Eigen::Vector3d mean = Eigen::Vector3d(sums.first[0], sums.first[1], sums.first[2]) / n;
      Eigen::Matrix3d covariance;
      covariance << sums.second[0], sums.second[1], sums.second[2], sums.second[1], sums.second[3], sums.second[4],
          sums.second[2], sums.second[4], sums.second[5];
      covariance = (covariance / n - mean * mean.transpose()) * step * step;
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
      eigen.computeDirect(covariance);
      const Eigen::Vector3d& values = eigen.eigenvalues();
      if (values[0] > kMaxThickness * kMaxThickness || values[0] > kMaxFlatness * values[1]) continue;
      const Eigen::Vector3d corner(static_cast<double>(sums.cell[0]), static_cast<double>(sums.cell[1]),
                                   static_cast<double>(sums.cell[2]));
      found[i] = {entries[i]->first,
                  {grid.edge * (corner.array() - grid.shift).matrix() + (mean.array() + 0.5).matrix() * step,
                   eigen.eigenvectors().col(0)}};
      is_plane[i] = 1;
    }
  });
  Planes planes;
  for (size_t i = 0; i < found.size(); ++i) {
    if (is_plane[i]) planes.insert(found[i]);
  }
  return planes;
}

// One scan onto the planes, from the pose that it has; the prior is the pose that was given.
Pose LaidOnto(const Planes& planes, const CellGrid& grid, const std::vector<Eigen::Vector3f>& points, const Pose& start,
              const Pose& given, const PoseRefinementParameters& parameters) {
  Pose pose = start;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Matrix6 information = Matrix6::Zero();
    Vector6 gradient = Vector6::Zero();
    const Eigen::Vector3d sensor = pose.translation();
    size_t matches = 0;
    for (const Eigen::Vector3f& point : points) {
      const Eigen::Vector3d at = pose * point.cast<double>();
      const auto found = planes.find(KeyOf(CellOf(grid.At(at))));
      if (found == planes.end()) continue;
      const Plane& plane = found->second;
      const double off = plane.normal.dot(at - plane.mean);
      const double ratio = off / parameters.robust_width;
      const double root = 1 / (1 + ratio * ratio);
      const double weight = root * root;
      Vector6 row;
      row << (at - sensor).cross(plane.normal), plane.normal;
      information.noalias() += weight * row * row.transpose();
      gradient.noalias() += weight * off * row;
      ++matches;
    }
    if (matches < kMinMatches) return given;
    const double prior = kPrior * static_cast<double>(matches);
    const Eigen::AngleAxisd turned(pose.linear() * given.linear().transpose());
    Vector6 deviation;
    deviation << turned.angle() * turned.axis(), pose.translation() - given.translation();
    information.diagonal().array() += prior;
    gradient += prior * deviation;
    const Vector6 step = information.ldlt().solve(-gradient);
    if (!step.allFinite()) return given;
    const double angle = step.head<3>().norm();
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    if (angle > 0) turn = Eigen::AngleAxisd(angle, step.head<3>() / angle).toRotationMatrix();
    pose.linear() = turn * pose.linear();
    pose.translation() += step.tail<3>();
    if (step.tail<3>().norm() < 1e-4 && angle < 1e-5) break;
  }
  const Pose moved = given.inverse() * pose;
  if (moved.translation().norm() > parameters.max_correction) return given;
  if (Eigen::AngleAxisd(moved.linear()).angle() > parameters.max_rotation) return given;
  return pose;
}

// Mean distance of the points from their planes, each at most the robust width, metres.
double MeanDistance(const std::vector<std::vector<Eigen::Vector3f>>& scans, std::span<const Pose> poses,
                    const PoseRefinementParameters& parameters) {
  const CellGrid grid{parameters.cell, kMeasuringShift};
  const Planes planes = PlanesOf(SumUp(scans, poses, grid), grid);
  std::vector<double> sums(scans.size());
  std::vector<size_t> counts(scans.size());
  tbb::parallel_for(size_t{0}, scans.size(), [&](size_t i) {
    for (const Eigen::Vector3f& point : scans[i]) {
      const Eigen::Vector3d at = poses[i] * point.cast<double>();
      const auto found = planes.find(KeyOf(CellOf(grid.At(at))));
      if (found == planes.end()) continue;
      sums[i] += std::min(std::abs(found->second.normal.dot(at - found->second.mean)), parameters.robust_width);
      ++counts[i];
    }
  });
  double sum = 0;
  size_t count = 0;
  for (size_t i = 0; i < sums.size(); ++i) {
    sum += sums[i];
    count += counts[i];
  }
  return count == 0 ? 0 : sum / static_cast<double>(count);
}

}  // namespace

absl::StatusOr<std::vector<Pose>> RefinePoses(const ScanSource& scans, std::span<const Pose> poses,
                                              const PoseRefinementParameters& parameters,
                                              const ProgressPart& progress) {
  std::vector<std::vector<Eigen::Vector3f>> thinned(scans.count);
  const auto thin = [&](size_t index, const Scan& scan) {
    const size_t stride = std::max<size_t>(1, scan.points.size() / static_cast<size_t>(parameters.points));
    std::vector<Eigen::Vector3f>& points = thinned[index];
    points.reserve(scan.points.size() / stride + 1);
    for (size_t i = 0; i < scan.points.size(); i += stride) {
      if (scan.points[i].allFinite()) points.push_back(scan.points[i]);
    }
    return absl::OkStatus();
  };
  if (auto status = ForEachScan(scans, progress, thin); !status.ok()) return status;
  const std::vector<Pose> given(poses.begin(), poses.end());
  std::vector<Pose> refined = given;
  for (int round = 0; round < parameters.rounds; ++round) {
    const CellGrid grid{parameters.cell, ShiftOf(round)};
    const Planes planes = PlanesOf(SumUp(thinned, refined, grid), grid);
    tbb::parallel_for(size_t{0}, refined.size(), [&](size_t i) {
      refined[i] = LaidOnto(planes, grid, thinned[i], refined[i], given[i], parameters);
    });
  }
  const double before = MeanDistance(thinned, given, parameters);
  const double gain = before - MeanDistance(thinned, refined, parameters);
  return gain >= parameters.min_gain * std::max(before, kFineDistance) ? refined : given;
}

}  // namespace mapkeep
