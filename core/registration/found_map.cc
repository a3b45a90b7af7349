#include <absl/strings/str_format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/registration/aligner.h"
#include "core/registration/point_tree.h"
#include "core/registration/surface_normals.h"
#include "core/registration/thinning.h"
#include "core/registration/up_direction.h"

namespace mapkeep {
namespace {

constexpr size_t kSampledScans = 30;    // evenly over the session: enough for a direction
constexpr double kMaxRoughness = 0.05;  // only flat surfaces vote
constexpr double kMinBelow = 0.3;       // metres below the sensor at which a surface may be ground

// The flat surfaces of one scan, in the session frame.
std::vector<SurfacePatch> PatchesOf(const Scan& scan, const Pose& pose, double voxel) {
  std::vector<Eigen::Vector3d> raw;
  raw.reserve(scan.points.size());
  for (const Eigen::Vector3f& point : scan.points) raw.push_back(point.cast<double>());
  const std::vector<Eigen::Vector3d> points = ThinPoints(raw, voxel);
  const PointTree tree(points);
  const auto surfaces = SurfaceNormalsAt(points, points, tree);
  std::vector<SurfacePatch> patches;
  for (size_t i = 0; i < points.size(); ++i) {
    if (surfaces[i].normal.isZero() || surfaces[i].roughness > kMaxRoughness) continue;
    const double side = surfaces[i].normal.dot(points[i]) > 0 ? -1 : 1;  // towards the sensor, the origin
    patches.push_back({pose.linear() * (side * surfaces[i].normal), points[i].z() < -kMinBelow});
  }
  return patches;
}

}  // namespace

absl::StatusOr<Alignment> FoundMapFrame(const ScanSource& scans, std::span<const Pose> poses,
                                        const AlignParameters& parameters, const Progress& progress) {
  if (scans.count != poses.size()) {
    return absl::InvalidArgumentError(absl::StrFormat("%d scans but %d poses", scans.count, poses.size()));
  }
  Alignment alignment;
  if (poses.empty()) {
    alignment.reason = "the session has no scans";
    return alignment;
  }
  const size_t step = (poses.size() + kSampledScans - 1) / kSampledScans;
  std::vector<SurfacePatch> patches;
  Eigen::Vector3d sensor_up = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < poses.size(); i += step) {
    const auto scan = scans.read(i);
    if (!scan.ok()) return scan.status();
    const auto of_scan = PatchesOf(*scan, poses[i], parameters.source_voxel);
    patches.insert(patches.end(), of_scan.begin(), of_scan.end());
    sensor_up += poses[i].linear().col(2);
    const double done = static_cast<double>(std::min(i + step, poses.size())) / static_cast<double>(poses.size());
    if (progress && !progress(done)) return absl::CancelledError("stopped while looking for the up direction");
  }
  const auto up = EstimateUpDirection(patches, sensor_up.stableNormalized());
  if (up) {
    const double tilt = std::acos(std::clamp(up->z(), -1.0, 1.0)) * 180 / std::numbers::pi;
    if (tilt > parameters.max_tilt) {
      alignment.reason = absl::StrFormat(
          "z is %.1f degrees off the up direction of its ground and walls, at most %.1f is allowed in the session that "
          "founds a map: turn its poses so that z points up",
          tilt, parameters.max_tilt);
      return alignment;
    }
  }
  alignment.accepted = true;
  alignment.poses.assign(poses.begin(), poses.end());
  return alignment;
}

}  // namespace mapkeep
