#include "core/registration/up_direction.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace mapkeep {
namespace {

constexpr double kRadian = std::numbers::pi / 180;
const double kGroundCosine = std::cos(35 * kRadian);  // a patch is ground within this angle of up,
const double kWallSine = std::sin(15 * kRadian);      // and a wall within this angle of upright
constexpr size_t kMinGround = 100;                    // patches; below this nothing is concluded
constexpr double kGroundWeight = 0.005;               // of a ground patch against a wall's: slopes tilt the ground
const double kRobustSine = std::sin(2 * kRadian);     // a patch that far off counts half
constexpr int kIterations = 20;

size_t GroundCount(std::span<const SurfacePatch> patches, const Eigen::Vector3d& up) {
  size_t count = 0;
  for (const SurfacePatch& patch : patches) {
    if (patch.below_sensor && patch.normal.dot(up) > kGroundCosine) ++count;
  }
  return count;
}

// The robust mean of the ground's normals, from a first guess.
Eigen::Vector3d GroundNormal(std::span<const SurfacePatch> patches, Eigen::Vector3d up) {
  for (int i = 0; i < kIterations; ++i) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const SurfacePatch& patch : patches) {
      if (!patch.below_sensor || !(patch.normal.dot(up) > kGroundCosine)) continue;
      const double off = patch.normal.cross(up).norm() / kRobustSine;
      sum += patch.normal / (1 + off * off);
    }
    up = sum.normalized();
  }
  return up;
}

// The direction at right angles to the walls that is closest to the ground's normal: a small turn of `ground`, by least
// squares with robust weights. Walls in one direction alone fix the tilt across themselves; the ground the rest.
Eigen::Vector3d RefinedByWalls(std::span<const SurfacePatch> patches, const Eigen::Vector3d& ground) {
  const auto ground_patches = static_cast<double>(GroundCount(patches, ground));
  Eigen::Vector3d up = ground;
  // Wide at first, so that walls count which the ground's tilt makes look slanted.
  double width = kWallSine;
  for (int i = 0; i < kIterations; ++i, width = std::max(0.8 * width, kRobustSine)) {
    const Eigen::Vector3d a = up.unitOrthogonal(), b = up.cross(a);
    const auto across = [&](const Eigen::Vector3d& v) { return Eigen::Vector2d(v.dot(a), v.dot(b)); };
    // The ground pulls back to its own normal; a wall pushes its normal into the horizontal.
    Eigen::Matrix2d matrix = kGroundWeight * ground_patches * Eigen::Matrix2d::Identity();
    Eigen::Vector2d right = kGroundWeight * ground_patches * across(ground);
    for (const SurfacePatch& patch : patches) {
      const double sine = patch.normal.dot(up);
      if (std::abs(sine) > kWallSine) continue;
      const double weight = 1 / (1 + sine * sine / (width * width));
      const Eigen::Vector2d normal = across(patch.normal);
      matrix += weight * normal * normal.transpose();
      right -= weight * sine * normal;
    }
    const Eigen::Vector2d step = matrix.ldlt().solve(right);
    if (!step.allFinite()) return ground;
    up = (up + step.x() * a + step.y() * b).normalized();
  }
  return up;
}

}  // namespace

std::optional<Eigen::Vector3d> EstimateUpDirection(std::span<const SurfacePatch> patches,
                                                   const Eigen::Vector3d& sensor_up) {
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const size_t about_z = GroundCount(patches, z), about_sensor = GroundCount(patches, sensor_up);
  if (std::max(about_z, about_sensor) < kMinGround) return std::nullopt;
  // A frame within reach of z keeps z as its guess: the sensor itself may be mounted at a slant.
  const Eigen::Vector3d guess = 2 * about_z >= about_sensor ? z : sensor_up;
  return RefinedByWalls(patches, GroundNormal(patches, guess));
}

}  // namespace mapkeep
