#include "client/simulator/session.h"

#include <absl/strings/str_format.h>

#include <memory>
#include <utility>

#include "client/simulator/random_stream.h"

namespace mapkeep {
namespace {

constexpr double kOwnPlace = 1.2;  // metres around the sensor, seen from above, in which nothing else drives
constexpr uint64_t kOdometryPart = ~uint64_t{0};
constexpr uint32_t kLargestLabelledId = 0xffff;

struct Stage {
  RayCaster caster;
  std::vector<SceneObject> objects;
  std::vector<bool> moving;                            // one an object
  std::vector<uint32_t> labels;                        // one an object
  std::vector<std::array<Eigen::Vector3f, 2>> bounds;  // one a mesh
  Ride ride;
};

double DurationOf(const Ride& ride) { return static_cast<double>(ride.scans) * ride.sensor.period; }

bool MovesSometime(const SceneObject& object, const Ride& ride) {
  return MovesWithin(object.track, 0, DurationOf(ride));
}

/// Whether a thing at `pose` (relative to the sensor) reaches into the sensor's own place.
bool Collides(const Pose& pose, const std::array<Eigen::Vector3f, 2>& bounds) {
  const Eigen::Vector3d sensor = pose.inverse().translation();  // in the thing's frame
  const Eigen::Vector2d nearest =
      sensor.head<2>().cwiseMax(bounds[0].head<2>().cast<double>()).cwiseMin(bounds[1].head<2>().cast<double>());
  const bool level = sensor.z() > bounds[0].z() - 3 && sensor.z() < bounds[1].z() + 3;
  return level && (sensor.head<2>() - nearest).norm() < kOwnPlace;
}

/// In every scan of the ride.
uint32_t LabelOf(const SceneObject& object, const Ride& ride) {
  const uint32_t id = object.id <= kLargestLabelledId ? object.id : 0;
  uint32_t truth = kStaticLabel;
  if (MovesSometime(object, ride)) {
    truth = FarthestWithin(object.track, 0, DurationOf(ride)) < kLeastTravel ? kUnsureLabel : kMovingLabel;
  }
  return id << 16 | truth;
}

std::vector<Ray> RaysOf(std::span<const Eigen::Vector3f> directions, const Ride& ride, const Pose& end) {
  std::vector<Ray> rays(directions.size());
  const size_t channels = ride.sensor.elevations.size();
  Eigen::Isometry3f moved = Eigen::Isometry3f::Identity();
  for (size_t i = 0; i < rays.size(); ++i) {
    if (!ride.rolling_shutter) {
      rays[i].direction = directions[i];
      continue;
    }
    const size_t firing = i / channels;
    const double fraction = static_cast<double>(firing) / static_cast<double>(ride.sensor.firings);
    if (i % channels == 0) moved = Between(Pose::Identity(), end, fraction).cast<float>();
    rays[i] = {moved.translation(), moved.linear() * directions[i], static_cast<float>(fraction)};
  }
  return rays;
}

absl::StatusOr<LabelledScan> CastScan(const Stage& stage, size_t index) {
  const Ride& ride = stage.ride;
  if (index >= ride.scans) {
    return absl::OutOfRangeError(absl::StrFormat("scan %d of a session of %d", index, ride.scans));
  }
  const double begin = static_cast<double>(index) * ride.sensor.period;
  const double end = ride.rolling_shutter ? begin + ride.sensor.period : begin;
  const Pose sensor = ride.sensor_pose(begin);
  const Pose to_sensor = sensor.inverse();
  const Pose sensor_end = to_sensor * ride.sensor_pose(end);

  std::vector<MeshInstance> instances;
  std::vector<uint32_t> labels;
  for (size_t i = 0; i < stage.objects.size(); ++i) {
    const SceneObject& object = stage.objects[i];
    if (!IsThere(object.state)) continue;
    const std::optional<Pose> there = PoseAt(object.track, begin);
    if (!there.has_value()) continue;
    const Pose from = to_sensor * *there;
    const Pose to = stage.moving[i] ? to_sensor * PoseAt(object.track, end).value_or(*there) : from;
    if (stage.moving[i] && Collides(from, stage.bounds[object.mesh])) continue;
    instances.push_back({object.mesh, from, to});
    labels.push_back(stage.labels[i]);
  }

  const uint64_t seed = SeedOf(ride.seed, index);
  const double phase = static_cast<double>(HashBits(seed) >> 11) * 0x1p-53;
  const std::vector<Eigen::Vector3f> directions = DirectionsOf(ride.sensor, index, phase);
  absl::StatusOr<std::vector<RayHit>> hits =
      stage.caster.Cast(instances, RaysOf(directions, ride, sensor_end), static_cast<float>(ride.sensor.max_range));
  if (!hits.ok()) return hits.status();
  LabelledScan measured = Measure(ride.sensor, directions, *hits, labels, seed);
  measured.scan.time = ride.start_time + begin;
  return measured;
}

absl::Status CheckScene(const RayCaster& caster, std::span<const SceneObject> objects, const Ride& ride) {
  if (ride.scans == 0) return absl::InvalidArgumentError("a ride of no scans");
  if (!ride.sensor_pose) return absl::InvalidArgumentError("a ride without a trajectory");
  if (ride.sensor.elevations.empty() || ride.sensor.firings == 0) {
    return absl::InvalidArgumentError("a sensor without beams");
  }
  for (const SceneObject& object : objects) {
    if (object.mesh >= caster.meshes().size()) {
      return absl::InvalidArgumentError(
          absl::StrFormat("object %d asks for mesh %d of %d", object.id, object.mesh, caster.meshes().size()));
    }
    if (object.track.empty()) return absl::InvalidArgumentError(absl::StrFormat("object %d is nowhere", object.id));
    for (size_t k = 1; k < object.track.size(); ++k) {
      if (!(object.track[k - 1].time < object.track[k].time)) {
        return absl::InvalidArgumentError(absl::StrFormat("the track of object %d goes back in time", object.id));
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<SimulatedSession> Simulate(const RayCaster& caster, std::vector<SceneObject> objects, const Ride& ride) {
  if (absl::Status checked = CheckScene(caster, objects, ride); !checked.ok()) return checked;
  auto stage = std::make_shared<Stage>(Stage{caster, std::move(objects), {}, {}, {}, ride});
  for (SceneObject& object : stage->objects) {
    stage->moving.push_back(MovesSometime(object, ride));
    stage->labels.push_back(LabelOf(object, ride));
    // What waits until after the end has not moved, and what is there for a moment only may not have either.
    if (stage->moving.back()) {
      object.state = ObjectState::kMoving;
    } else if (object.state == ObjectState::kMoving) {
      object.state = ObjectState::kParked;
    }
  }
  for (const TriangleMesh& mesh : caster.meshes()) stage->bounds.push_back(BoundsOf(mesh));

  SimulatedSession session;
  session.objects = stage->objects;
  session.mesh_bounds = stage->bounds;
  for (size_t i = 0; i < ride.scans; ++i) {
    const double time = static_cast<double>(i) * ride.sensor.period;
    session.truth.push_back(ride.sensor_pose(time));
    session.times.push_back(ride.start_time + time);
  }
  session.odometry = OdometryOf(session.truth, ride.odometry, SeedOf(ride.seed, kOdometryPart));
  std::shared_ptr<const Stage> held = std::move(stage);
  session.labelled = [held](size_t index) { return CastScan(*held, index); };
  session.scans = {ride.scans, [held](size_t index) -> absl::StatusOr<Scan> {
                     absl::StatusOr<LabelledScan> scan = CastScan(*held, index);
                     if (!scan.ok()) return scan.status();
                     return std::move(scan->scan);
                   }};
  return session;
}

}  // namespace mapkeep
