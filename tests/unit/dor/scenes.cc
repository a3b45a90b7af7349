#include "tests/unit/dor/scenes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace mapkeep {
namespace {

// The distance at which the ray enters the box, or infinity.
double Enters(const Box& box, const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  double enter = 0, leave = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (box.low[axis] - from[axis]) / direction[axis];
    const double b = (box.high[axis] - from[axis]) / direction[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter <= leave ? enter : std::numeric_limits<double>::infinity();
}

}  // namespace

std::vector<Eigen::Vector3d> World::Returns(const Eigen::Vector3d& sensor, int beams, int columns) const {
  constexpr double kDegrees = std::numbers::pi / 180;
  constexpr double kStep = 0.5;  // metres: the ground is found by marching, then by bisection
  std::vector<Eigen::Vector3d> returns;
  for (int column = 0; column < columns; ++column) {
    const double azimuth = (column + 0.5) * 2 * std::numbers::pi / columns;
    for (int beam = 0; beam < beams; ++beam) {
      const double elevation = (-24 + 28.0 * beam / std::max(1, beams - 1) + 0.013) * kDegrees;
      const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                                      std::sin(elevation));
      double distance = range;
      for (const Box& box : boxes) distance = std::min(distance, Enters(box, sensor, direction));
      const auto below = [&](double along) {
        const Eigen::Vector3d at = sensor + along * direction;
        return at.z() < ground(at.x(), at.y());
      };
      for (double along = kStep; direction.z() < 0 && along - kStep < distance; along += kStep) {
        if (!below(along)) continue;
        double above = along - kStep;
        for (int halving = 0; halving < 16; ++halving)
          (below((above + along) / 2) ? along : above) = (above + along) / 2;
        distance = std::min(distance, along);
        break;
      }
      if (distance < range) returns.emplace_back(sensor + distance * direction);
    }
  }
  return returns;
}

Session Drive(int scans, const std::function<Pose(int)>& pose, const std::function<World(int)>& world, int beams,
              int columns) {
  Session session;
  for (int i = 0; i < scans; ++i) {
    const Pose at = pose(i);
    Add(session, at, world(i).Returns(at.translation(), beams, columns));
  }
  return session;
}

}  // namespace mapkeep
