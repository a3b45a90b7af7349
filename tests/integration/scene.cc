#include "tests/integration/scene.h"

#include <cmath>
#include <numbers>
#include <optional>

namespace mapkeep {
namespace {

constexpr int kAzimuths = 360, kElevations = 32;
constexpr double kLowest = -0.5, kHighest = 0.25;  // radians
constexpr double kRange = 40;                      // metres

Eigen::AlignedBox3d BoxOf(double x, double y, double z, double to_x, double to_y, double to_z) {
  return {Eigen::Vector3d(x, y, z), Eigen::Vector3d(to_x, to_y, to_z)};
}

// Distance at which the ray enters the box, if it does.
std::optional<double> Entry(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& from, const Eigen::Vector3d& along) {
  double enter = 0, leave = kRange;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (box.min()[axis] - from[axis]) / along[axis], b = (box.max()[axis] - from[axis]) / along[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter > 0 && enter < leave ? std::optional(enter) : std::nullopt;
}

}  // namespace

Scene Street() {
  Scene scene = {
      BoxOf(-60, -60, -1, 60, 60, -0.3),  // ground
      BoxOf(-30, 13, -0.3, 30, 14, 6),    // walls
      BoxOf(-30, -20, -0.3, 30, -19, 6), BoxOf(-31, -20, -0.3, -30, 14, 6), BoxOf(30, -20, -0.3, 31, 14, 6),
  };
  // What stands on one side only, so that the street turned about does not look like itself.
  scene.push_back(BoxOf(-29, -19, -0.3, -18, -11, 5));  // a house
  scene.push_back(BoxOf(-8, -17, -0.3, -5, -9, 3));     // a shed
  scene.push_back(BoxOf(14, -19, -0.3, 15, -12, 2.5));  // a wall across the yard
  scene.push_back(BoxOf(22, 6, -0.3, 27, 8, 4));        // a stall
  for (int i = 0; i < 5; ++i) scene.push_back(BoxOf(-24 + 11 * i, 9, -0.3, -23.2 + 11 * i, 9.8, 4));
  return scene;
}

Eigen::AlignedBox3d Car() { return BoxOf(7.5, -4.5, 0.1, 11.5, -2.7, 1.5); }

Scan CastRays(const Scene& scene, const Pose& pose, double time) {
  Scan scan{.time = time};
  for (int e = 0; e < kElevations; ++e) {
    const double elevation = kLowest + (kHighest - kLowest) * e / (kElevations - 1);
    for (int a = 0; a < kAzimuths; ++a) {
      // Off the axes, so that no ray is parallel to a face.
      const double azimuth = 2 * std::numbers::pi * (a + 0.37) / kAzimuths;
      const Eigen::Vector3d ray(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                                std::sin(elevation));
      double nearest = kRange;
      for (const Eigen::AlignedBox3d& box : scene) {
        const auto entry = Entry(box, pose.translation(), pose.linear() * ray);
        if (entry) nearest = std::min(nearest, *entry);
      }
      if (nearest == kRange) continue;
      scan.points.push_back((nearest * ray).cast<float>());
      scan.intensities.push_back(0.5F);
    }
  }
  return scan;
}

Drive DriveAlong(const Scene& scene, int scans, double start, const Eigen::Vector3d& offset, double along) {
  Drive drive;
  for (int i = 0; i < scans; ++i) {
    Pose pose = Pose::Identity();
    pose.translate(Eigen::Vector3d(along - 0.25 * scans + 0.5 * i, 2.0, 1.5));
    pose.rotate(Eigen::AngleAxisd(0.02 * std::sin(0.3 * i), Eigen::Vector3d::UnitZ()));
    drive.scans.push_back(CastRays(scene, pose, start + 0.1 * i));
    pose.pretranslate(offset);
    drive.poses.push_back(pose);
  }
  return drive;
}

}  // namespace mapkeep
