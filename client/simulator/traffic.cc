#include "client/simulator/traffic.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "client/simulator/random_stream.h"

namespace mapkeep {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kReach = 160;       // metres from the robot beyond which nobody is simulated
constexpr double kKeyStep = 0.2;     // seconds between the keys of a track
constexpr double kSearchStep = 1.0;  // seconds
constexpr double kTrafficSpeed = 8;  // metres a second
constexpr double kCyclingSpeed = 4.2;
constexpr double kCyclingLine = 2.95;  // |d|: between the lane and the parked cars

/// Street coordinates of something at a time; nothing while it is beyond the row's ends.
using Path = std::function<std::optional<RobotPlace>(double time)>;

/// To and fro between 0 and `length`, and which way.
std::pair<double, bool> ToAndFro(double travel, double length) {
  const double u = std::fmod(travel, 2 * length);
  return u < length ? std::pair(u, true) : std::pair(2 * length - u, false);
}

class Traffic {
 public:
  Traffic(const Street& street, const TrafficParameters& parameters, const RobotPath& robot, double robot_speed,
          double duration, uint64_t seed, uint32_t first_id)
      : street_(street),
        ground_(street.ground),
        parameters_(parameters),
        robot_(robot),
        robot_speed_(robot_speed),
        duration_(duration),
        random_(seed),
        next_id_(first_id) {}

  /// In the robot's lane, before it and behind it, at its own speed.
  void AddConvoy() {
    const RobotPlace start = robot_(0);
    const double direction = std::cos(start.yaw) > 0 ? 1 : -1;
    for (const double gap : {15.0, 27.0, 42.0, -14.0, -29.0}) {
      if (!random_.Chance(0.8 * parameters_.density)) continue;
      const double swing = random_.Uniform(0, 2 * kPi);
      AddVehicle([=, this](double time) {
        // Distances swing by up to 2 m, as drivers do not hold them.
        const double travel = robot_speed_ * Clock(time) + gap + 2 * (1 - std::cos(time / 3)) / 2 * std::sin(swing);
        return OnRoad(start.s + direction * travel, direction, kLane);
      });
    }
  }

  /// One stream of vehicles at the same speed in one direction.
  void AddStream(double direction, double line, double speed, double spacing, const std::vector<uint32_t>* cyclists) {
    if (parameters_.density <= 0) return;
    const double span = ground_.end() - ground_.begin() + speed * duration_;
    for (double behind = random_.Uniform(0, spacing); behind < span;
         behind += spacing / parameters_.density * random_.Uniform(0.6, 1.6)) {
      const double s0 = direction > 0 ? ground_.end() - behind : ground_.begin() + behind;
      const Path path = [=, this](double time) {
        const double seconds = cyclists == nullptr ? Clock(time) : time;
        return OnRoad(s0 + direction * speed * seconds, direction, line);
      };
      if (cyclists == nullptr) {
        AddVehicle(path);
      } else {
        Add(ObjectKind::kCyclist, (*cyclists)[random_.Index(cyclists->size())], path);
      }
    }
  }

  void AddPedestrians() {
    const double count = 7 * parameters_.density;
    for (const StreetPlan& plan : ground_.plans()) {
      for (int i = 0; i < count; ++i) {
        const double side = random_.Chance(0.5) ? 1 : -1;
        const double d = side * random_.Uniform(6.5, 8.2), s = plan.begin + random_.Uniform(0, kStreetLength);
        const double speed = random_.Uniform(0.9, 1.7), length = random_.Uniform(15, 40),
                     ahead = random_.Uniform(0, 80);
        AddWalker([=](double time) -> std::optional<RobotPlace> {
          const auto [at, forward] = ToAndFro(ahead + speed * time, length);
          return RobotPlace{s + at, d, forward ? 0 : kPi};
        });
      }
      for (int i = 0; i < count / 3; ++i) {  // some cross the road at the crossing
        const double s = plan.begin + random_.Uniform(1.5, kCrossing - 1.5);
        const double speed = random_.Uniform(0.9, 1.6), ahead = random_.Uniform(0, 36);
        AddWalker([=](double time) -> std::optional<RobotPlace> {
          const auto [at, forward] = ToAndFro(ahead + speed * time, 18);
          return RobotPlace{s, at - 9, forward ? kPi / 2 : -kPi / 2};
        });
      }
    }
  }

  /// People who mill about on 16 m of pavement.
  void AddCrowds() {
    for (const StreetPlan& plan : ground_.plans()) {
      const double side = random_.Chance(0.5) ? 1 : -1;
      const double middle = plan.begin + random_.Uniform(22, kStreetLength - 10);
      for (int i = 0; i < parameters_.crowd; ++i) {
        const double s = middle + random_.Uniform(-7, 7), d = side * (7.1 + random_.Uniform(-0.6, 0.6));
        const double along = random_.Uniform(0.8, 3), across = random_.Uniform(0.2, 0.6);
        const double pace = random_.Uniform(0.15, 0.5), phase = random_.Uniform(0, 2 * kPi);
        AddWalker([=](double time) -> std::optional<RobotPlace> {
          const double u = pace * time + phase;
          return RobotPlace{s + along * std::sin(u), d + across * std::sin(1.7 * u + phase),
                            std::atan2(across * 1.7 * std::cos(1.7 * u + phase), along * std::cos(u))};
        });
      }
    }
  }

  std::vector<SceneObject> Take() { return std::move(objects_); }

 private:
  double Clock(double time) const { return parameters_.stop_and_go ? StopAndGoTime(time) : time; }

  std::optional<RobotPlace> OnRoad(double s, double direction, double line) const {
    if (s < ground_.begin() + 3 || s > ground_.end() - 3) return std::nullopt;
    return RobotPlace{s, -direction * line, direction > 0 ? 0 : kPi};
  }

  void AddVehicle(const Path& path) {
    const bool lorry = random_.Chance(0.12);
    const std::vector<uint32_t>& shapes = lorry ? street_.shared.lorries : street_.shared.cars;
    Add(lorry ? ObjectKind::kLorry : ObjectKind::kCar, shapes[random_.Index(shapes.size())], path);
  }

  void AddWalker(const Path& path) {
    const std::vector<uint32_t>& shapes = street_.shared.pedestrians;
    Add(ObjectKind::kPedestrian, shapes[random_.Index(shapes.size())], path);
  }

  /// The first and last search time at which the path is near the robot.
  std::optional<std::pair<double, double>> TimeNearRobot(const Path& path) const {
    std::optional<std::pair<double, double>> near;
    for (double time = 0; time < duration_ + kSearchStep; time += kSearchStep) {
      const std::optional<RobotPlace> place = path(time);
      if (!place.has_value() || std::abs(place->s - robot_(time).s) > kReach) continue;
      if (!near.has_value()) near = {time, time};
      near->second = time;
    }
    return near;
  }

  void Add(ObjectKind kind, uint32_t mesh, const Path& path) {
    const auto near = TimeNearRobot(path);
    if (!near.has_value()) return;
    Track track;
    const double last = near->second + kSearchStep;
    for (int i = 0;; ++i) {
      const double time = near->first + kKeyStep * i;
      if (time > last) break;
      const std::optional<RobotPlace> place = path(time);
      if (!place.has_value()) break;
      const bool wheels = kind == ObjectKind::kCar || kind == ObjectKind::kLorry;
      track.push_back({time, wheels ? ground_.OnWheelsAt(place->s, place->d, place->yaw)
                                    : ground_.UprightAt(place->s, place->d, place->yaw)});
    }
    if (track.size() < 2) return;
    objects_.push_back(
        {.id = next_id_++, .kind = kind, .state = ObjectState::kMoving, .mesh = mesh, .track = std::move(track)});
  }

  const Street& street_;
  const Ground& ground_;
  const TrafficParameters& parameters_;
  const RobotPath& robot_;
  double robot_speed_, duration_;
  RandomStream random_;
  uint32_t next_id_;
  std::vector<SceneObject> objects_;
};

constexpr double kGap = 7;        // metres from the middle of a car to the robot's, behind which it stands
constexpr double kHeadway = 1;    // seconds that it keeps besides
constexpr double kLookAhead = 3;  // seconds for which the robot must not come by when a car pulls out

// Whether the robot drives in the lane at `d`, with its traffic.
bool IsInLane(const RobotPlace& robot, double d) { return std::abs(robot.d - d) < kLane && std::cos(robot.yaw) > 0; }

double LaneOf(const ParkingSlot& slot) { return slot.d < 0 ? -kLane : kLane; }

// Whether whoever stands in `slot` can pull out at `time` without being in the robot's way.
bool IsClear(const ParkingSlot& slot, double time, const RobotPath& robot) {
  for (double when = time; when <= time + kLookAhead; when += kKeyStep) {
    const RobotPlace place = robot(when);
    if (IsInLane(place, LaneOf(slot)) && std::abs(place.s - slot.s) < kGap) return false;
  }
  return true;
}

// The time nearest to `time` at which it can, if there is one until `latest`.
std::optional<double> ClearNear(const ParkingSlot& slot, double time, double latest, const RobotPath& robot) {
  for (double off = 0; time - off > 0 || time + off <= latest; off += kKeyStep) {
    if (time + off <= latest && IsClear(slot, time + off, robot)) return time + off;
    if (time - off > 0 && IsClear(slot, time - off, robot)) return time - off;
  }
  return std::nullopt;
}

}  // namespace

double StopAndGoTime(double time) {
  // 2 s of pulling away, 4 s at speed, 2 s of braking, 4 s of standing.
  constexpr double kCycle = 12, kCycleTravel = 6;
  const double cycles = std::floor(time / kCycle), t = time - cycles * kCycle;
  double travel = kCycleTravel;
  if (t < 2) {
    travel = t * t / 4;
  } else if (t < 6) {
    travel = 1 + (t - 2);
  } else if (t < 8) {
    travel = kCycleTravel - (8 - t) * (8 - t) / 4;
  }
  return cycles * kCycleTravel + travel;
}

std::vector<SceneObject> TrafficOf(const Street& street, const TrafficParameters& parameters, const RobotPath& robot,
                                   double robot_speed, double duration, uint64_t seed, uint32_t first_id) {
  Traffic traffic(street, parameters, robot, robot_speed, duration, seed, first_id);
  if (parameters.density > 0) {
    const double against = std::cos(robot(0).yaw) > 0 ? -1 : 1;
    traffic.AddConvoy();
    traffic.AddStream(against, kLane, kTrafficSpeed, 30, nullptr);
    for (const double direction : {1.0, -1.0}) {
      traffic.AddStream(direction, kCyclingLine, kCyclingSpeed, 70, &street.shared.cyclists);
    }
    traffic.AddPedestrians();
  }
  traffic.AddCrowds();
  return traffic.Take();
}

Track DriveOff(const Street& street, const ParkingSlot& slot, double time, double latest, const RobotPath& robot) {
  constexpr double kAcceleration = 1.8, kPullOut = 11, kWay = 90;  // metres a second^2; metres; metres
  constexpr int kMaxKeys = 3000;                                   // ten minutes behind a robot that stands
  Track track = {{0, street.ground.OnWheelsAt(slot.s, slot.d, slot.yaw)}};
  const std::optional<double> begin = ClearNear(slot, time, latest, robot);
  if (!begin.has_value()) return track;
  const double lane = LaneOf(slot);
  double travel = 0, speed = 0;
  for (int i = 0; i < kMaxKeys; ++i) {
    const double now = *begin + kKeyStep * i, s = slot.s + travel;
    if (travel > kWay || s > street.ground.end() - 3) break;
    const double u = std::clamp(travel / kPullOut, 0.0, 1.0);
    const double d = slot.d + (lane - slot.d) * u * u * (3 - 2 * u);
    const double turn = std::atan2((lane - slot.d) * 6 * u * (1 - u), kPullOut);
    const double yaw = u < 1 ? (1 - u) * slot.yaw + turn : turn;
    if (now > 0) track.push_back({now, street.ground.OnWheelsAt(s, d, yaw)});
    const RobotPlace ahead = robot(now);
    double allowed = kTrafficSpeed;
    if (IsInLane(ahead, lane) && ahead.s > s) allowed = std::clamp((ahead.s - s - kGap) / kHeadway, 0.0, allowed);
    const double next = std::min(speed + kAcceleration * kKeyStep, allowed);
    travel += kKeyStep * (speed + next) / 2;
    speed = next;
  }
  return track;
}

}  // namespace mapkeep
