#pragma once

#include <random>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/scan.h"
#include "core/registration/aligner.h"

namespace mapkeep {

/// A flat piece of wall or ground: corner + s u + t v for s, t in [0, 1].
struct Rectangle {
  Eigen::Vector3d corner, u, v;
};

using Scene = std::vector<Rectangle>;

/// A street along x from `from` to `to` metres, 16 m wide: ground, facades with porches every 9 m of changing depth.
Scene StreetOf(double from, double to);

/// The same with porches of any width, depth and height at any distance: no part looks like another.
Scene VariedStreetOf(double from, double to);

/// Two endless walls and a ground: nothing tells where along x one is.
Scene CorridorOf(double from, double to);

/// Points spread evenly over the scene, `per_square_metre` of them, with 1 cm of noise.
std::vector<Eigen::Vector3d> SampleOf(const Scene& scene, double per_square_metre, std::mt19937& random);

/// The map of a scene: points 0.2 m apart on average, with their normals.
RegistrationTarget TargetOf(const Scene& scene);

/// The same with the normals turned towards the middle of the street, as a map stores them.
RegistrationTarget FacingStreet(RegistrationTarget target);

/// What a sensor sees from each of the poses within 25 m: every scan a sample of its own.
std::vector<Scan> ScansOf(const Scene& scene, const std::vector<Pose>& poses);

/// A drive along x, 1.8 m above the ground, `step` metres a scan.
std::vector<Pose> DriveAlong(double from, double to, double step);

/// Rotation by degrees about z, then a shift.
Pose MotionOf(double yaw_degrees, const Eigen::Vector3d& shift);

/// Expects each pose within `metres` and `degrees` of its truth.
void ExpectNear(const std::vector<Pose>& poses, const std::vector<Pose>& truth, double metres, double degrees);

}  // namespace mapkeep
