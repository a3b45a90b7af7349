#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// Scenes small enough to be followed by hand.
struct Session {
  std::vector<Scan> scans;
  std::vector<Pose> poses;

  ScanSource source() const { return SourceOf(scans); }
};

inline Pose At(double x, double y, double z) { return Pose(Eigen::Translation3d(x, y, z)); }

/// A scan that is taken at `pose` and returns from the given points of the world.
inline Scan ScanOf(const Pose& pose, const std::vector<Eigen::Vector3d>& world) {
  Scan scan;
  for (const Eigen::Vector3d& point : world) scan.points.emplace_back((pose.inverse() * point).cast<float>());
  return scan;
}

inline void Add(Session& session, const Pose& pose, const std::vector<Eigen::Vector3d>& world) {
  session.scans.push_back(ScanOf(pose, world));
  session.poses.push_back(pose);
}

/// A box that rays stop at, metres.
struct Box {
  Eigen::Vector3d low, high;
};

/// Where a ray first meets the boxes or the ground, whose height may depend on the place; nothing within the range.
struct World {
  std::vector<Box> boxes;
  std::function<double(double x, double y)> ground = [](double, double) { return 0.0; };
  double range = 40;

  /// Every return of a spinning sensor of `beams` beams from -24 to +4 degrees and `columns` columns.
  std::vector<Eigen::Vector3d> Returns(const Eigen::Vector3d& sensor, int beams, int columns) const;
};

/// A session over worlds that change from scan to scan.
Session Drive(int scans, const std::function<Pose(int)>& pose, const std::function<World(int)>& world, int beams = 32,
              int columns = 360);

}  // namespace mapkeep
