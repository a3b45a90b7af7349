#include "tests/unit/registration/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace mapkeep {
namespace {

constexpr double kNoise = 0.01;
constexpr double kRange = 25;

// An upright wall from (x0, y0) to (x1, y1).
Rectangle Wall(double x0, double y0, double x1, double y1, double height) {
  return {{x0, y0, 0}, {x1 - x0, y1 - y0, 0}, {0, 0, height}};
}

template <typename Use>
void Sample(const Rectangle& rectangle, double per_square_metre, std::mt19937& random, const Use& use) {
  std::uniform_real_distribution<double> share(0, 1);
  std::normal_distribution<double> noise(0, kNoise);
  const auto count = std::lround(rectangle.u.cross(rectangle.v).norm() * per_square_metre);
  for (long i = 0; i < count; ++i) {
    const Eigen::Vector3d off(noise(random), noise(random), noise(random));
    use(rectangle.corner + share(random) * rectangle.u + share(random) * rectangle.v + off);
  }
}

}  // namespace

Scene CorridorOf(double from, double to) {
  return {{{from, -8, 0}, {to - from, 0, 0}, {0, 16, 0}}, Wall(from, -8, to, -8, 6), Wall(from, 8, to, 8, 6)};
}

Scene StreetOf(double from, double to) {
  Scene scene = CorridorOf(from, to);
  int number = 0;
  for (double x = from + 3; x + 3 < to; x += 9, ++number) {
    const double depth = 1 + 0.7 * (number % 3), width = 2 + 0.5 * (number % 4), side = number % 2 == 0 ? 8 : -8;
    const double front = side - std::copysign(depth, side);
    scene.push_back(Wall(x, side, x, front, 4));
    scene.push_back(Wall(x, front, x + width, front, 4));
    scene.push_back(Wall(x + width, front, x + width, side, 4));
  }
  return scene;
}

Scene VariedStreetOf(double from, double to) {
  Scene scene = CorridorOf(from, to);
  std::mt19937 random(17);
  const auto any = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
  };
  for (double x = from + 2; x + 6 < to; x += any(3, 8)) {
    const double side = random() % 2 == 0 ? 8 : -8, width = any(1, 5), height = any(2, 7);
    const double front = side - std::copysign(any(0.7, 3.5), side);
    scene.push_back(Wall(x, side, x, front, height));
    scene.push_back(Wall(x, front, x + width, front, height));
    scene.push_back(Wall(x + width, front, x + width, side, height));
  }
  return scene;
}

std::vector<Eigen::Vector3d> SampleOf(const Scene& scene, double per_square_metre, std::mt19937& random) {
  std::vector<Eigen::Vector3d> points;
  for (const Rectangle& rectangle : scene) {
    Sample(rectangle, per_square_metre, random, [&](const Eigen::Vector3d& point) { points.push_back(point); });
  }
  return points;
}

RegistrationTarget TargetOf(const Scene& scene) {
  std::mt19937 random(11);
  RegistrationTarget target{.voxel_size = 0.2};
  for (const Rectangle& rectangle : scene) {
    const Eigen::Vector3d normal = rectangle.u.cross(rectangle.v).normalized();
    Sample(rectangle, 25, random, [&](const Eigen::Vector3d& point) {
      target.points.push_back(point);
      target.normals.push_back(normal);
    });
  }
  return target;
}

RegistrationTarget FacingStreet(RegistrationTarget target) {
  const size_t count = target.points.size();
  for (size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d point = target.points[i], normal = target.normals[i];
    if (std::abs(normal.x()) > 0.9) {  // across the street: nothing hides anything here, so it is seen from both sides
      target.points.push_back(point);
      target.normals.push_back(-normal);
    } else if (normal.dot(Eigen::Vector3d(point.x(), 0, 1.8) - point) < 0) {
      target.normals[i] = -normal;
    }
  }
  return target;
}

std::vector<Scan> ScansOf(const Scene& scene, const std::vector<Pose>& poses) {
  std::mt19937 random(5);
  std::vector<Scan> scans;
  for (const Pose& pose : poses) {
    Scan scan;
    const Pose to_sensor = pose.inverse();
    for (const Eigen::Vector3d& point : SampleOf(scene, 3, random)) {
      const Eigen::Vector3d seen = to_sensor * point;
      if (seen.norm() < kRange) scan.points.push_back(seen.cast<float>());
    }
    scans.push_back(std::move(scan));
  }
  return scans;
}

std::vector<Pose> DriveAlong(double from, double to, double step) {
  std::vector<Pose> poses;
  const auto count = static_cast<int>(std::lround((to - from) / step));
  for (int i = 0; i <= count; ++i) {
    Pose pose = MotionOf(3 * std::sin(0.2 * i), {from + i * step, 0.5 * std::sin(0.1 * i), 1.8});
    poses.push_back(pose);
  }
  return poses;
}

Pose MotionOf(double yaw_degrees, const Eigen::Vector3d& shift) {
  return Eigen::Translation3d(shift) *
         Eigen::AngleAxisd(yaw_degrees * std::numbers::pi / 180, Eigen::Vector3d::UnitZ());
}

void ExpectNear(const std::vector<Pose>& poses, const std::vector<Pose>& truth, double metres, double degrees) {
  ASSERT_EQ(poses.size(), truth.size());
  for (size_t i = 0; i < poses.size(); ++i) {
    EXPECT_LT((poses[i].translation() - truth[i].translation()).norm(), metres) << "scan " << i;
    EXPECT_LT(AngleBetween(poses[i], truth[i]) * 180 / std::numbers::pi, degrees) << "scan " << i;
  }
}

}  // namespace mapkeep
