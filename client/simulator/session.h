#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "client/simulator/measurement.h"
#include "client/simulator/odometry.h"
#include "client/simulator/ray_caster.h"
#include "client/simulator/scene_object.h"
#include "client/simulator/sensor.h"
#include "core/geometry/pose.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// How a sensor is carried through a scene.
struct Ride {
  SensorModel sensor;
  size_t scans = 100;
  double start_time = 0;                    ///< seconds since 1970, of the first scan
  std::function<Pose(double)> sensor_pose;  ///< truth at a time since the start: the scene's frame from the sensor's
  bool rolling_shutter = false;             ///< false: all rays of a scan are of its start, as if deskewed perfectly
  OdometryParameters odometry;
  uint64_t seed = 1;
};

/// One simulated session. Everything but the points is in memory; those are cast when they are read.
struct SimulatedSession {
  ScanSource scans;  ///< the points, as a reader gives them
  /// A scan with its labels; the same points as `scans` gives. May be called from several threads.
  std::function<absl::StatusOr<LabelledScan>(size_t index)> labelled;
  std::vector<Pose> truth;           ///< one a scan, at its start: the scene's frame from the sensor's
  std::vector<Pose> odometry;        ///< one a scan, in the session's own frame
  std::vector<double> times;         ///< one a scan, seconds since 1970
  std::vector<SceneObject> objects;  ///< what stands, stood or moves where; its state is kMoving just if it does
  std::vector<std::array<Eigen::Vector3f, 2>> mesh_bounds;  ///< lowest and highest corner of each mesh
};

/// What comes less far than this from where it was first, in a whole session, has not gone anywhere: about the width of
/// a body. Metres.
inline constexpr double kLeastTravel = 0.5;

/// Sends a sensor through a scene of meshes and objects. Labels follow SemanticKITTI, whose labels the KTH benchmark
/// scores by, too: what moves at any time of the session is moving in every scan of it, also while it waits, the rest
/// is static. Annotators do not see a person shift their weight; so an object that moves but comes nowhere kLeastTravel
/// away from its first place is kUnsureLabel. (SemanticKITTI says "if it moved in some scan while observing them"; who
/// was hit by a ray is known only when the scans are cast, so that whoever scores has to drop what was not seen
/// moving.) What would stand within the sensor's own place (1.2 m) is left out of that scan. The same arguments give
/// the same bytes on any number of threads. INVALID_ARGUMENT if there is no scan, no trajectory, a track that is empty
/// or out of order, or a mesh that the caster has not.
absl::StatusOr<SimulatedSession> Simulate(const RayCaster& caster, std::vector<SceneObject> objects, const Ride& ride);

}  // namespace mapkeep
