#pragma once

#include <cstdint>
#include <vector>

#include "client/simulator/mesh.h"
#include "client/simulator/street_plan.h"
#include "core/geometry/pose.h"

namespace mapkeep {

/// The ground of a row of streets: a centre line that bends and climbs, a cambered road between kerbs that are lowered
/// at drives, pavements, ramps and lawns. The row has one street more at either end, into which no robot drives, so
/// that traffic comes and goes out of sight.
class Ground {
 public:
  /// `repeated`: every street is the first one's copy. `level`: the centre line is straight along x, at height 0.
  Ground(uint64_t seed, int streets, bool repeated, bool level = false);

  /// Length that may be driven, [0, length] in s.
  double length() const { return kStreetLength * streets_; }
  double begin() const { return -kStreetLength; }
  double end() const { return length() + kStreetLength; }

  /// From the one before the row to the one behind it.
  const std::vector<StreetPlan>& plans() const { return plans_; }

  /// Height of the ground at street coordinates.
  double HeightAt(double s, double d) const;
  /// A point of the common frame (z up, metres) at street coordinates, `above` the ground.
  Eigen::Vector3d PointAt(double s, double d, double above = 0) const;
  /// A thing upright at street coordinates, turned by `yaw` from the direction of s.
  Pose UprightAt(double s, double d, double yaw, double above = 0) const;
  /// A vehicle with its wheels on the ground.
  Pose OnWheelsAt(double s, double d, double yaw, double above = 0) const;

  /// The surface of one street as triangles of 1 m along s, rough by some millimetres (grass: centimetres), relative to
  /// PointAt(plan.begin, 0).
  TriangleMesh MeshOf(const StreetPlan& plan) const;

 private:
  double HeadingAt(double s) const;
  double ProfileAt(double s) const;
  const StreetPlan& PlanAt(double s) const;

  int streets_;
  std::vector<StreetPlan> plans_;
  std::vector<double> heading_knots_, height_knots_, long_height_knots_;
  std::vector<Eigen::Vector2d> line_;  // points of the centre line, kLineStep apart, from begin()
};

}  // namespace mapkeep
