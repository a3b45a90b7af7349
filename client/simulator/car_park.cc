#include "client/simulator/car_park.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include "client/simulator/building.h"
#include "client/simulator/random_stream.h"
#include "client/simulator/road_users.h"

namespace mapkeep {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr float kHalfLength = 30, kHalfWidth = 16, kStorey = 3, kSlab = 0.28F;
constexpr float kRampHalfLength = 18, kRampHalfWidth = 3;
constexpr float kParapet = 0.95F;
constexpr double kAisle = 7.5, kEnd = 24;                   // |y| of the aisles, |x| of the lanes that join them
constexpr double kFirstSession = 1780300800, kDay = 86400;  // 2026-06-01 08:00 UTC
constexpr uint32_t kIdsASlot = 64;                          // cars of a slot before their ids repeat
constexpr uint64_t kSlotPart = 21, kSessionPart = 22;

void AddSlabs(TriangleMesh& mesh) {
  const float low = kStorey - kSlab;
  // The upper floor leaves the ramp open.
  AddBox(mesh, {-kHalfLength, kRampHalfWidth, low}, {kHalfLength, kHalfWidth, kStorey}, Material::kConcrete);
  AddBox(mesh, {-kHalfLength, -kHalfWidth, low}, {kHalfLength, -kRampHalfWidth, kStorey}, Material::kConcrete);
  AddBox(mesh, {-kHalfLength, -kRampHalfWidth, low}, {-kRampHalfLength, kRampHalfWidth, kStorey}, Material::kConcrete);
  AddBox(mesh, {kRampHalfLength, -kRampHalfWidth, low}, {kHalfLength, kRampHalfWidth, kStorey}, Material::kConcrete);
  AddBox(mesh, {-kHalfLength, -kHalfWidth, 2 * kStorey - kSlab}, {kHalfLength, kHalfWidth, 2 * kStorey},
         Material::kConcrete);
}

void AddRamp(TriangleMesh& mesh) {
  for (const float under : {0.0F, kSlab}) {
    AddQuad(mesh, {-kRampHalfLength, -kRampHalfWidth, -under}, {-kRampHalfLength, kRampHalfWidth, -under},
            {kRampHalfLength, kRampHalfWidth, kStorey - under}, {kRampHalfLength, -kRampHalfWidth, kStorey - under},
            Material::kConcrete);
  }
  // Parapets around the opening, but where the ramp arrives.
  const float top = kStorey + kParapet;
  for (const float y : {-kRampHalfWidth - 0.15F, kRampHalfWidth}) {
    AddBox(mesh, {-kRampHalfLength, y, kStorey}, {kRampHalfLength, y + 0.15F, top}, Material::kConcrete);
  }
  AddBox(mesh, {-kRampHalfLength - 0.15F, -kRampHalfWidth, kStorey}, {-kRampHalfLength, kRampHalfWidth, top},
         Material::kConcrete);
}

void AddSides(TriangleMesh& mesh) {
  for (const float floor : {0.0F, kStorey}) {
    const float top = floor + kParapet;
    for (const float y : {-kHalfWidth, kHalfWidth - 0.15F}) {
      AddBox(mesh, {-kHalfLength, y, floor}, {kHalfLength, y + 0.15F, top}, Material::kConcrete);
    }
    for (const float x : {-kHalfLength, kHalfLength - 0.15F}) {
      AddBox(mesh, {x, -kHalfWidth, floor}, {x + 0.15F, kHalfWidth, top}, Material::kConcrete);
    }
    for (float x = -22.5F; x < 23; x += 7.5F) {
      for (const float y : {-15.6F, -3.45F, 3.45F, 15.6F}) {
        AddBox(mesh, {x - 0.2F, y - 0.2F, floor}, {x + 0.2F, y + 0.2F, floor + kStorey - kSlab}, Material::kConcrete);
      }
    }
    // A lift shaft and a stair in two corners: without them one end looks like the other.
    AddBox(mesh, {26.5F, 11, floor}, {29.8F, 15.8F, floor + kStorey - kSlab}, Material::kBrick);
    AddBox(mesh, {-29.8F, -15.8F, floor}, {-27.5F, -12, floor + kStorey - kSlab}, Material::kPlaster);
  }
}

/// A way through points, its corners rounded.
class Route {
 public:
  Route() {
    const double up = kStorey, a = kAisle, e = kEnd, r = kRampHalfLength;
    points_ = {{-e, -a, 0}, {e, -a, 0},   {e, a, 0},   {-e, a, 0}, {-e, 0, 0}, {-r, 0, 0}, {r, 0, up}, {e, 0, up},
               {e, -a, up}, {-e, -a, up}, {-e, a, up}, {e, a, up}, {e, 0, up}, {r, 0, up}, {-r, 0, 0}, {-e, 0, 0}};
    lengths_.push_back(0);
    for (size_t i = 0; i < points_.size(); ++i) {
      lengths_.push_back(lengths_.back() + (points_[(i + 1) % points_.size()] - points_[i]).norm());
    }
  }

  Pose PoseAt(double travel) const {
    constexpr double kLook = 0.4;
    const Eigen::Vector3d ahead = Smooth(travel + kLook), behind = Smooth(travel - kLook);
    const Eigen::Vector3d way = ahead - behind;
    return Eigen::Translation3d((ahead + behind) / 2) *
           Eigen::AngleAxisd(std::atan2(way.y(), way.x()), Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(-std::atan2(way.z(), way.head<2>().norm()), Eigen::Vector3d::UnitY());
  }

 private:
  Eigen::Vector3d Sharp(double travel) const {
    double u = std::fmod(travel, lengths_.back());
    if (u < 0) u += lengths_.back();
    const auto after = std::upper_bound(lengths_.begin() + 1, lengths_.end() - 1, u);
    const auto i = static_cast<size_t>(after - lengths_.begin()) - 1;
    const double t = (u - lengths_[i]) / (lengths_[i + 1] - lengths_[i]);
    return (1 - t) * points_[i] + t * points_[(i + 1) % points_.size()];
  }

  /// The mean of 5 m of the way.
  Eigen::Vector3d Smooth(double travel) const {
    constexpr int kHalf = 10;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int i = -kHalf; i <= kHalf; ++i) sum += Sharp(travel + 0.25 * i);
    return sum / (2 * kHalf + 1);
  }

  std::vector<Eigen::Vector3d> points_;
  std::vector<double> lengths_;  // travel at each point, the last one the whole
};

/// Slots along the outer sides of both floors.
std::vector<Pose> Slots() {
  std::vector<Pose> slots;
  for (const double floor : {0.0, double{kStorey}}) {
    for (const double side : {-1.0, 1.0}) {
      for (double x = -24.3; x < 25; x += 2.7) {
        slots.push_back(Eigen::Translation3d(x, side * 13.2, floor) *
                        Eigen::AngleAxisd(side * kPi / 2, Eigen::Vector3d::UnitZ()));
      }
    }
  }
  return slots;
}

SceneObject Car(uint32_t id, ObjectState state, uint32_t mesh, Track track) {
  return {.id = id, .kind = ObjectKind::kCar, .state = state, .mesh = mesh, .track = std::move(track)};
}

/// What a slot holds and held. Whoever comes on a day when another leaves waits for a day: the slot is empty in
/// between.
void AddParked(std::vector<SceneObject>& objects, const CarPark& car_park, int session, uint32_t& next_id) {
  const std::vector<Pose> slots = Slots();
  for (size_t slot = 0; slot < slots.size(); ++slot) {
    RandomStream random(SeedOf(SeedOf(car_park.parameters.seed, kSlotPart), slot));
    bool taken = random.Chance(car_park.parameters.occupancy), taken_before = taken;
    uint32_t holder = 0;  // counts the cars that this slot has seen
    for (int i = 0; i < session; ++i) {
      taken_before = taken;
      if (random.Chance(car_park.parameters.change_rate)) {
        taken = !taken;
        if (taken) ++holder;
      }
    }
    const uint32_t id = next_id + holder % kIdsASlot;
    next_id += kIdsASlot;
    if (!taken && !taken_before) continue;
    ObjectState state = ObjectState::kParked;
    if (taken && !taken_before) state = ObjectState::kArrived;
    if (!taken) state = ObjectState::kLeft;
    const uint64_t shape = SeedOf(SeedOf(car_park.parameters.seed, slot), holder);
    objects.push_back(Car(id, state, car_park.cars[shape % car_park.cars.size()], {{0, slots[slot]}}));
  }
}

Track TrackOf(const std::function<Pose(double)>& pose, double duration) {
  constexpr double kStep = 0.2;
  Track track;
  for (int i = 0; kStep * i < duration + 2 * kStep; ++i) track.push_back({kStep * i, pose(kStep * i)});
  return track;
}

void AddMoving(std::vector<SceneObject>& objects, const CarPark& car_park, const DriveParameters& parameters,
               uint64_t seed, uint32_t& next_id) {
  const double duration = static_cast<double>(parameters.scans) * parameters.sensor.period;
  RandomStream random(seed);
  const Route route;
  for (const double gap : {13.0, -12.0}) {
    if (parameters.traffic.density <= 0) break;
    const auto drive = [&](double time) { return route.PoseAt(parameters.start + parameters.speed * time + gap); };
    objects.push_back(Car(next_id++, ObjectState::kMoving, car_park.cars[random.Index(car_park.cars.size())],
                          TrackOf(drive, duration)));
  }
  for (int i = 0; i < parameters.traffic.crowd; ++i) {
    const double x = random.Uniform(-22, 10), y = random.Uniform(9.3, 10.3) * (random.Chance(0.5) ? 1 : -1);
    const double z = random.Chance(0.5) ? kStorey : 0, way = random.Uniform(5, 14), pace = random.Uniform(0.8, 1.5);
    const auto walk = [=](double time) {
      const double u = std::fmod(pace * time, 2 * way);
      const Pose at(Eigen::Translation3d(x + std::min(u, 2 * way - u), y, z));
      return u < way ? at : Pose(at * Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitZ()));
    };
    objects.push_back({.id = next_id++,
                       .kind = ObjectKind::kPedestrian,
                       .state = ObjectState::kMoving,
                       .mesh = car_park.pedestrians[random.Index(car_park.pedestrians.size())],
                       .track = TrackOf(walk, duration)});
  }
}

absl::Status CheckShare(double value, const char* name) {
  if (value >= 0 && value <= 1) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat("%s is %g: expected 0 to 1", name, value));
}

}  // namespace

absl::StatusOr<CarPark> MakeCarPark(const CarParkParameters& parameters) {
  absl::Status checked = CheckShare(parameters.occupancy, "occupancy");
  checked.Update(CheckShare(parameters.change_rate, "change_rate"));
  if (!checked.ok()) return checked;
  std::vector<TriangleMesh> meshes;
  std::vector<SceneObject> fixed;
  const auto stand = [&](ObjectKind kind, TriangleMesh mesh, const Pose& pose) {
    fixed.push_back({.id = static_cast<uint32_t>(fixed.size() + 1),
                     .kind = kind,
                     .mesh = static_cast<uint32_t>(meshes.size()),
                     .track = {{0, pose}}});
    meshes.push_back(std::move(mesh));
  };
  TriangleMesh ground, floors, sides;
  AddQuad(ground, {-90, -80, 0}, {90, -80, 0}, {90, 80, 0}, {-90, 80, 0}, Material::kAsphalt);
  stand(ObjectKind::kGround, std::move(ground), Pose::Identity());
  AddSlabs(floors);
  AddRamp(floors);
  stand(ObjectKind::kGround, std::move(floors), Pose::Identity());
  AddSides(sides);
  stand(ObjectKind::kBuilding, std::move(sides), Pose::Identity());
  RandomStream random(parameters.seed);
  for (int i = 0; i < 8; ++i) {
    const double angle = kPi / 4 * i + random.Uniform(-0.1, 0.1), width = random.Uniform(12, 22);
    const Eigen::Vector3d at(random.Uniform(46, 54) * std::cos(angle), random.Uniform(32, 40) * std::sin(angle), 0);
    // A house's front looks to its -y: here at the car park.
    const Pose pose = Eigen::Translation3d(at) * Eigen::AngleAxisd(angle - kPi / 2, Eigen::Vector3d::UnitZ());
    stand(ObjectKind::kBuilding, MakeBuilding(static_cast<float>(width), 10, random.Bits()), pose);
  }
  std::vector<uint32_t> cars, pedestrians;
  for (int i = 0; i < 12; ++i) {
    cars.push_back(static_cast<uint32_t>(meshes.size()));
    meshes.push_back(MakeCar(random.Bits()));
  }
  for (int i = 0; i < 5; ++i) {
    pedestrians.push_back(static_cast<uint32_t>(meshes.size()));
    meshes.push_back(MakePedestrian(random.Bits()));
  }
  absl::StatusOr<RayCaster> caster = RayCaster::Create(std::move(meshes));
  if (!caster.ok()) return caster.status();
  return CarPark{parameters, *std::move(caster), std::move(fixed), std::move(cars), std::move(pedestrians)};
}

absl::StatusOr<SimulatedSession> DriveThroughCarPark(const CarPark& car_park, int session,
                                                     const DriveParameters& parameters) {
  if (absl::Status checked = CheckDrive(parameters, session); !checked.ok()) return checked;
  if (parameters.reverse || parameters.traffic.stop_and_go) {
    return absl::InvalidArgumentError("reverse and stop_and_go are not for car parks");
  }
  const uint64_t seed = SeedOf(SeedOf(car_park.parameters.seed, kSessionPart), static_cast<uint64_t>(session));
  std::vector<SceneObject> objects = car_park.fixed;
  auto next_id = static_cast<uint32_t>(objects.size() + 1);
  AddParked(objects, car_park, session, next_id);
  AddMoving(objects, car_park, parameters, seed, next_id);
  Ride ride{.sensor = parameters.sensor,
            .scans = parameters.scans,
            .start_time = kFirstSession + kDay * session,
            .rolling_shutter = parameters.rolling_shutter,
            .odometry = parameters.odometry,
            .seed = seed};
  ride.sensor_pose = [route = Route(), start = parameters.start, speed = parameters.speed,
                      height = parameters.sensor.height](double time) {
    return Pose(route.PoseAt(start + speed * time) * Eigen::Translation3d(0, 0, height));
  };
  return Simulate(car_park.caster, std::move(objects), ride);
}

}  // namespace mapkeep
