#include "core/ratio_map/scan_voxels.h"

#include <absl/container/flat_hash_map.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapkeep {
namespace {

// Consecutive points of a scan in one voxel: integer sums, so that the order of points does not matter.
struct Run {
  VoxelKey key{};
  uint32_t points = 0;
  uint32_t ground = 0;
  std::array<uint64_t, 3> position{};
  uint64_t intensity = 0;
  uint64_t mask = 0;

  void Add(const Run& other) {
    points += other.points;
    ground += other.ground;
    for (int axis = 0; axis < 3; ++axis) position[axis] += other.position[axis];
    intensity += other.intensity;
    mask |= other.mask;
  }
};

uint32_t Fraction(double value) {
  return static_cast<uint32_t>(std::clamp(value * kFractionScale, 0.0, kFractionScale - 1.0));
}

// Largest integer not above a value that is known to fit: what std::floor gives, without a call.
int32_t Floor(double value) {
  const auto truncated = static_cast<int32_t>(value);
  return truncated - (value < truncated ? 1 : 0);
}

absl::StatusOr<std::vector<Run>> RunsOfScan(const Scan& scan, const Pose& pose, std::span<const PointLabel> labels,
                                            double voxel_size) {
  std::vector<Run> runs;
  runs.reserve(scan.points.size() / 2);
  VoxelIndex last;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (labels[i] == PointLabel::kDynamic) continue;
    const Eigen::Vector3d point = pose * scan.points[i].cast<double>();
    // The same arithmetic as VoxelIndexOf, which a point that fits need not be given to.
    const Eigen::Vector3d at = point / voxel_size;
    constexpr double kLimit = kVoxelLimit;
    const bool fits = at.x() >= -kLimit && at.x() < kLimit && at.y() >= -kLimit && at.y() < kLimit &&
                      at.z() >= -kLimit && at.z() < kLimit;
    if (!fits) {
      const absl::Status status = VoxelIndexOf(point, voxel_size).status();
      return absl::Status(status.code(), absl::StrFormat("point %d: %s", i, status.message()));
    }
    const VoxelIndex voxel{Floor(at.x()), Floor(at.y()), Floor(at.z())};
    if (runs.empty() || voxel != last) {
      runs.push_back({.key = VoxelKeyOf(voxel)});
      last = voxel;
    }
    const Eigen::Vector3d inside = at - Eigen::Vector3d(voxel.x, voxel.y, voxel.z);
    const std::array<uint32_t, 3> fraction{Fraction(inside.x()), Fraction(inside.y()), Fraction(inside.z())};
    constexpr uint32_t kSubVoxel = kFractionScale / 4;
    Run& run = runs.back();
    ++run.points;
    run.ground += labels[i] == PointLabel::kGround ? 1 : 0;
    for (int axis = 0; axis < 3; ++axis) run.position[axis] += fraction[axis];
    run.intensity += scan.intensities.empty() ? 0 : Fraction(scan.intensities[i]);
    run.mask |=
        uint64_t{1} << (fraction[0] / kSubVoxel + 4 * (fraction[1] / kSubVoxel) + 16 * (fraction[2] / kSubVoxel));
  }
  return runs;
}

// Runs of one voxel put together, then sorted: fewer than there were, and by their keys alone, since a run is long.
std::vector<Run> ByKey(std::vector<Run> runs) {
  absl::flat_hash_map<VoxelKey, uint32_t> numbers;
  numbers.reserve(runs.size());
  std::vector<std::pair<VoxelKey, uint32_t>> order;
  for (uint32_t i = 0; i < runs.size(); ++i) {
    const auto [found, is_new] = numbers.try_emplace(runs[i].key, i);
    if (is_new) {
      order.emplace_back(runs[i].key, i);
    } else {
      runs[found->second].Add(runs[i]);
    }
  }
  std::ranges::sort(order);
  std::vector<Run> sorted;
  sorted.reserve(order.size());
  for (const auto& [key, number] : order) sorted.push_back(runs[number]);
  return sorted;
}

ScanVoxel Summary(const Run& run, const Eigen::Vector3d& sensor, double voxel_size) {
  ScanVoxel voxel{.key = run.key, .ground = 2 * uint64_t{run.ground} > run.points, .mask = run.mask};
  for (int axis = 0; axis < 3; ++axis) voxel.mean[axis] = static_cast<uint16_t>(run.position[axis] / run.points);
  voxel.intensity = static_cast<uint16_t>(run.intensity / run.points);
  const Eigen::Vector3d centre =
      CornerOf(VoxelIndexOf(run.key), voxel_size) + Eigen::Vector3d::Constant(voxel_size / 2);
  const Eigen::Vector3d towards = (sensor - centre).stableNormalized() * kFractionScale;
  for (int axis = 0; axis < 3; ++axis) voxel.towards_sensor[axis] = static_cast<int16_t>(std::lround(towards[axis]));
  return voxel;
}

}  // namespace

absl::StatusOr<std::vector<ScanVoxel>> VoxelsOfScan(const Scan& scan, const Pose& pose,
                                                    std::span<const PointLabel> labels, double voxel_size) {
  auto runs = RunsOfScan(scan, pose, labels, voxel_size);
  if (!runs.ok()) return runs.status();
  std::vector<ScanVoxel> voxels;
  const std::vector<Run> sums = ByKey(*std::move(runs));
  voxels.reserve(sums.size());
  for (const Run& sum : sums) voxels.push_back(Summary(sum, pose.translation(), voxel_size));
  return voxels;
}

}  // namespace mapkeep
