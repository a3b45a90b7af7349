#include "client/simulator/street_session.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "client/simulator/parking.h"
#include "client/simulator/random_stream.h"

namespace mapkeep {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kFirstSession = 1780300800;  // 2026-06-01 08:00 UTC
constexpr double kDay = 86400;
constexpr double kMargin = 5;     // metres of street before and behind the route
constexpr double kLeastAway = 3;  // seconds of a session for which a waiting car must be gone
constexpr uint64_t kSessionPart = 100;

/// The robot's loop: up the right lane, a half circle, down the other, a half circle.
RobotPlace PlaceOnRoute(double length, double travel, bool reverse) {
  const double straight = length - 2 * kMargin, half_turn = kPi * kLane, lap = 2 * (straight + half_turn);
  double u = std::fmod(travel, lap);
  if (u < 0) u += lap;
  // The other way round: begin in the far corner, whose lane leads back.
  if (reverse) u = std::fmod(u + straight + half_turn, lap);
  if (u < straight) return {kMargin + u, -kLane, 0};
  u -= straight;
  if (u < half_turn) {
    const double angle = u / kLane;
    return {length - kMargin + kLane * std::sin(angle), -kLane * std::cos(angle), angle};
  }
  u -= half_turn;
  if (u < straight) return {length - kMargin - u, kLane, kPi};
  const double angle = (u - straight) / kLane;
  return {kMargin - kLane * std::sin(angle), kLane * std::cos(angle), kPi + angle};
}

}  // namespace

double StartOfSession(int session) { return kFirstSession + kDay * session; }

Pose SwayAt(double time, double speed) {
  const double amount = std::min(1.0, speed / 5);
  const double pitch = 0.004 * std::sin(2.1 * time) + 0.002 * std::sin(7.3 * time + 1);
  const double roll = 0.003 * std::sin(1.7 * time + 2) + 0.002 * std::sin(6.1 * time);
  const double heave = 0.008 * std::sin(3.3 * time + 0.5);
  return Eigen::Translation3d(0, 0, amount * heave) * Eigen::AngleAxisd(amount * pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(amount * roll, Eigen::Vector3d::UnitX());
}

absl::Status CheckDrive(const DriveParameters& parameters, int session) {
  if (session < 0) return absl::InvalidArgumentError(absl::StrFormat("session is %d: expected 0 or more", session));
  if (parameters.scans == 0) return absl::InvalidArgumentError("scans is 0: expected at least 1");
  if (!(parameters.speed >= 0 && parameters.speed <= 50)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("speed is %g: expected 0 to 50 metres a second", parameters.speed));
  }
  if (!(parameters.start >= 0)) {
    return absl::InvalidArgumentError(absl::StrFormat("start is %g: expected 0 metres or more", parameters.start));
  }
  if (!(parameters.odometry.drift >= 0)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("drift is %g: expected 0 metres or more in 100 m", parameters.odometry.drift));
  }
  if (!(parameters.traffic.density >= 0) || parameters.traffic.crowd < 0) {
    return absl::InvalidArgumentError("traffic is negative");
  }
  return absl::OkStatus();
}

std::vector<SceneObject> StandingIn(const Street& street, int session, const DriveParameters& parameters,
                                    const RobotPath& robot, uint32_t& next_id) {
  const double duration = static_cast<double>(parameters.scans) * parameters.sensor.period;
  Occupancy occupancy = OccupancyOf(street, session);
  std::vector<SceneObject> objects = street.fixed;
  std::move(occupancy.constructions.begin(), occupancy.constructions.end(), std::back_inserter(objects));
  for (ParkedVehicle& vehicle : occupancy.vehicles) {
    if (vehicle.drives_off) {
      const bool in_time = parameters.traffic.wait + kLeastAway <= duration;
      const double wait = in_time ? parameters.traffic.wait : duration / 2;
      vehicle.object.track = DriveOff(street, vehicle.slot, wait, std::max(wait, duration - kLeastAway), robot);
      vehicle.object.state = ObjectState::kMoving;
    }
    objects.push_back(std::move(vehicle.object));
  }
  next_id = occupancy.next_id;
  return objects;
}

absl::StatusOr<SimulatedSession> DriveThrough(const Street& street, int session, const DriveParameters& parameters) {
  if (absl::Status checked = CheckDrive(parameters, session); !checked.ok()) return checked;
  const uint64_t seed = SeedOf(SeedOf(street.parameters.seed, kSessionPart), static_cast<uint64_t>(session));
  const TrafficParameters& traffic = parameters.traffic;
  const double duration = static_cast<double>(parameters.scans) * parameters.sensor.period;
  const auto ground = std::make_shared<const Ground>(street.ground);

  const RobotPath robot = [ground, parameters](double time) {
    const double clock = parameters.traffic.stop_and_go ? StopAndGoTime(time) : time;
    return PlaceOnRoute(ground->length(), parameters.start + parameters.speed * clock, parameters.reverse);
  };

  uint32_t next_id = 0;
  std::vector<SceneObject> objects = StandingIn(street, session, parameters, robot, next_id);
  std::vector<SceneObject> passing =
      TrafficOf(street, traffic, robot, parameters.speed, duration, SeedOf(seed, 1), next_id);
  std::move(passing.begin(), passing.end(), std::back_inserter(objects));

  Ride ride{.sensor = parameters.sensor,
            .scans = parameters.scans,
            .start_time = StartOfSession(session),
            .rolling_shutter = parameters.rolling_shutter,
            .odometry = parameters.odometry,
            .seed = seed};
  ride.sensor_pose = [ground, robot, height = parameters.sensor.height, speed = parameters.speed](double time) {
    const RobotPlace place = robot(time);
    return Pose(ground->OnWheelsAt(place.s, place.d, place.yaw) * SwayAt(time, speed) *
                Eigen::Translation3d(0, 0, height));
  };
  return Simulate(street.caster, std::move(objects), ride);
}

}  // namespace mapkeep
