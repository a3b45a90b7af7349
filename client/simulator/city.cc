#include "client/simulator/city.h"

#include <absl/strings/str_format.h>

#include <array>
#include <cmath>
#include <iterator>
#include <memory>
#include <numbers>
#include <utility>

#include "client/simulator/random_stream.h"

namespace mapkeep {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kFirst = kCrossing / 2;  // s of the first crossing's middle in every row
constexpr double kTurn = 7;               // metres: radius of a turn on the middle of the road
constexpr uint32_t kIdsARow = 16000;      // labels have room for 65,535 ids
constexpr uint64_t kRowPart = 31, kSessionPart = 32;

/// The rows' frames: two along x, two along y; their crossings fall together.
std::array<Pose, 4> Places() {
  const Pose along_x(Eigen::Translation3d(-kFirst, 0, 0));
  const Pose along_y(Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitZ()) * Eigen::Translation3d(-kFirst, 0, 0));
  return {along_x, Eigen::Translation3d(0, kStreetLength, 0) * along_x, along_y,
          Eigen::Translation3d(kStreetLength, 0, 0) * along_y};
}

struct RoundPlace {
  Eigen::Vector2d at;
  double yaw = 0;
};

/// `travel` metres along the middle of the roads from the first crossing, counter-clockwise; moved `right` of it.
RoundPlace PlaceOnRound(double travel, double right) {
  const double straight = kStreetLength - 2 * kTurn, arc = kPi / 2 * kTurn, side = straight + arc;
  double u = std::fmod(travel, 4 * side);
  if (u < 0) u += 4 * side;
  const double corner = std::floor(u / side), along = u - corner * side;
  // The southern side from the first crossing, begun where its turn ends; the other sides are the same, turned.
  RoundPlace place;
  if (along < straight) {
    place = {{kTurn + along, 0}, 0};
  } else {
    const double angle = (along - straight) / kTurn;
    place = {{kStreetLength - kTurn + kTurn * std::sin(angle), kTurn - kTurn * std::cos(angle)}, angle};
  }
  place.at += right * Eigen::Vector2d(std::sin(place.yaw), -std::cos(place.yaw));
  const Eigen::Vector2d middle = Eigen::Vector2d::Constant(kStreetLength / 2);
  place.at = middle + Eigen::Rotation2Dd(corner * kPi / 2) * (place.at - middle);
  place.yaw += corner * kPi / 2;
  return place;
}

/// Where the robot is at a time, in the city's frame.
RoundPlace RobotAt(const DriveParameters& parameters, double time) {
  const double travel = parameters.start + parameters.speed * time;
  if (!parameters.reverse) return PlaceOnRound(travel, kLane);
  RoundPlace place = PlaceOnRound(-travel, -kLane);
  place.yaw += kPi;
  return place;
}

RobotPlace InRow(const City::Row& row, const RoundPlace& place) {
  const Eigen::Vector3d at = row.place.inverse() * Eigen::Vector3d(place.at.x(), place.at.y(), 0);
  const Eigen::Vector3d ahead =
      row.place.linear().transpose() * Eigen::Vector3d(std::cos(place.yaw), std::sin(place.yaw), 0);
  return {at.x(), at.y(), std::atan2(ahead.y(), ahead.x())};
}

/// The robot stands on the road that it is nearest to the middle of.
Pose OnWheels(const City& city, const RoundPlace& place) {
  const City::Row* on = nullptr;
  RobotPlace best;
  for (const City::Row& row : city.rows) {
    const RobotPlace in_row = InRow(row, place);
    if (on != nullptr && std::abs(in_row.d) >= std::abs(best.d)) continue;
    on = &row;
    best = in_row;
  }
  return on->place * on->street.ground.OnWheelsAt(best.s, best.d, best.yaw);
}

void Place(std::vector<SceneObject>& objects, const Pose& place) {
  for (SceneObject& object : objects) {
    for (TrackKey& key : object.track) key.pose = place * key.pose;
    if (object.previous.has_value()) object.previous = place * *object.previous;
  }
}

void Shift(std::vector<uint32_t>& meshes, uint32_t by) {
  for (uint32_t& mesh : meshes) mesh += by;
}

}  // namespace

double LengthOfRound() { return 4 * (kStreetLength - 2 * kTurn + kPi / 2 * kTurn); }

absl::StatusOr<City> MakeCity(const StreetParameters& parameters) {
  std::vector<TriangleMesh> meshes;
  std::vector<StreetParts> built;
  std::vector<StreetParameters> of_rows;
  const std::array<Pose, 4> places = Places();
  for (uint32_t k = 0; k < places.size(); ++k) {
    StreetParameters row = parameters;
    row.seed = SeedOf(SeedOf(parameters.seed, kRowPart), k);
    row.streets = 1;
    row.repeated = false;
    row.level = true;
    row.extension_from.reset();
    row.fence_until.reset();
    absl::StatusOr<StreetParts> parts = BuildStreet(row);
    if (!parts.ok()) return parts.status();
    const auto first_mesh = static_cast<uint32_t>(meshes.size());
    std::move(parts->meshes.begin(), parts->meshes.end(), std::back_inserter(meshes));
    SharedMeshes& shared = parts->shared;
    for (auto* shelf : {&shared.cars, &shared.lorries, &shared.cyclists, &shared.pedestrians, &shared.constructions}) {
      Shift(*shelf, first_mesh);
    }
    for (SceneObject& object : parts->fixed) {
      object.mesh += first_mesh;
      object.id += k * kIdsARow;
    }
    built.push_back(*std::move(parts));
    of_rows.push_back(row);
  }
  absl::StatusOr<RayCaster> caster = RayCaster::Create(std::move(meshes));
  if (!caster.ok()) return caster.status();
  City city{parameters.seed, *caster, {}};
  for (size_t k = 0; k < built.size(); ++k) {
    const auto next_id = static_cast<uint32_t>(k * kIdsARow + built[k].fixed.size() + 1);
    city.rows.push_back({{of_rows[k],
                          std::move(built[k].ground),
                          *caster,
                          std::move(built[k].shared),
                          std::move(built[k].fixed),
                          {},
                          next_id},
                         places[k]});
  }
  return city;
}

absl::StatusOr<SimulatedSession> DriveThroughCity(const City& city, int session, const DriveParameters& parameters) {
  if (absl::Status checked = CheckDrive(parameters, session); !checked.ok()) return checked;
  if (parameters.traffic.stop_and_go) return absl::InvalidArgumentError("stop_and_go is not for cities");
  const uint64_t seed = SeedOf(SeedOf(city.seed, kSessionPart), static_cast<uint64_t>(session));
  const double duration = static_cast<double>(parameters.scans) * parameters.sensor.period;
  std::vector<SceneObject> objects;
  for (size_t k = 0; k < city.rows.size(); ++k) {
    const City::Row& row = city.rows[k];
    uint32_t next_id = 0;
    const RobotPath robot = [&row, &parameters](double time) { return InRow(row, RobotAt(parameters, time)); };
    std::vector<SceneObject> in_row = StandingIn(row.street, session, parameters, robot, next_id);
    std::vector<SceneObject> passing =
        TrafficOf(row.street, parameters.traffic, robot, parameters.speed, duration, SeedOf(seed, k + 1), next_id);
    std::move(passing.begin(), passing.end(), std::back_inserter(in_row));
    Place(in_row, row.place);
    std::move(in_row.begin(), in_row.end(), std::back_inserter(objects));
  }
  Ride ride{.sensor = parameters.sensor,
            .scans = parameters.scans,
            .start_time = StartOfSession(session),
            .rolling_shutter = parameters.rolling_shutter,
            .odometry = parameters.odometry,
            .seed = seed};
  ride.sensor_pose = [shared = std::make_shared<const City>(city), parameters](double time) {
    return Pose(OnWheels(*shared, RobotAt(parameters, time)) * SwayAt(time, parameters.speed) *
                Eigen::Translation3d(0, 0, parameters.sensor.height));
  };
  return Simulate(city.caster, std::move(objects), ride);
}

}  // namespace mapkeep
