#include "core/ratio_map/scan_voxels.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

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

absl::StatusOr<std::vector<Run>> RunsOfScan(const Scan& scan, const Pose& pose, std::span<const PointLabel> labels,
                                            double voxel_size) {
  std::vector<Run> runs;
  VoxelIndex last;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (labels[i] == PointLabel::kDynamic) continue;
    const Eigen::Vector3d point = pose * scan.points[i].cast<double>();
    const auto voxel = VoxelIndexOf(point, voxel_size);
    if (!voxel.ok()) {
      return absl::Status(voxel.status().code(), absl::StrFormat("point %d: %s", i, voxel.status().message()));
    }
    if (runs.empty() || *voxel != last) {
      runs.push_back({.key = VoxelKeyOf(*voxel)});
      last = *voxel;
    }
    const Eigen::Vector3d inside = point / voxel_size - Eigen::Vector3d(voxel->x, voxel->y, voxel->z);
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
  std::ranges::sort(*runs, {}, &Run::key);
  std::vector<ScanVoxel> voxels;
  for (size_t begin = 0; begin < runs->size();) {
    Run sum = (*runs)[begin];
    size_t end = begin + 1;
    for (; end < runs->size() && (*runs)[end].key == sum.key; ++end) sum.Add((*runs)[end]);
    voxels.push_back(Summary(sum, pose.translation(), voxel_size));
    begin = end;
  }
  return voxels;
}

}  // namespace mapkeep
