#include "client/simulator/parking.h"

#include <algorithm>
#include <numbers>
#include <optional>
#include <utility>

#include "client/simulator/random_stream.h"

namespace mapkeep {
namespace {

constexpr uint64_t kParkingPart = 11, kSitePart = 12;
constexpr double kSiteTaken = 0.4;      // share of the sites that are built on at first
constexpr double kStaysInStreet = 0.5;  // share of the vehicles that leave their slot for another one

struct Vehicle {
  uint32_t id = 0;
  uint32_t mesh = 0;
  size_t slot = 0;
  bool drives_off = false;
};

/// One street's slots through the sessions.
class StreetSlots {
 public:
  /// `index` tells copies of a street apart: their cars differ.
  StreetSlots(const Street& street, const StreetPlan& plan, uint64_t index)
      : street_(street),
        plan_(plan),
        random_(SeedOf(SeedOf(plan.seed, kParkingPart), index)),
        holders_(plan.slots.size()) {}

  /// Vehicles of the first session. Ids are drawn from `next_id`.
  void Open(uint32_t& next_id) {
    for (size_t slot = 0; slot < holders_.size(); ++slot) {
      if (random_.Chance(street_.parameters.occupancy)) holders_[slot] = NewVehicle(slot, next_id);
    }
    ChooseWhoDrivesOff();
    Report(std::vector<std::optional<Vehicle>>(holders_), {});
  }

  /// The next session's.
  void NextDay(uint32_t& next_id) {
    for (std::optional<Vehicle>& vehicle : holders_) {
      if (vehicle.has_value() && vehicle->drives_off) vehicle.reset();
    }
    const std::vector<std::optional<Vehicle>> before = holders_;
    std::vector<size_t> free;
    for (size_t slot = 0; slot < before.size(); ++slot) {
      if (!before[slot].has_value()) free.push_back(slot);
    }
    random_.Shuffle(free);
    const auto take = [&]() -> std::optional<size_t> {
      if (free.empty()) return std::nullopt;
      const size_t slot = free.back();
      free.pop_back();
      return slot;
    };
    std::vector<Vehicle> left;
    for (size_t slot = 0; slot < before.size(); ++slot) {
      if (!before[slot].has_value() || !random_.Chance(street_.parameters.change_rate)) continue;
      const std::optional<size_t> elsewhere = random_.Chance(kStaysInStreet) ? take() : std::nullopt;
      if (elsewhere.has_value()) {
        holders_[*elsewhere] = before[slot];
        holders_[*elsewhere]->slot = *elsewhere;
      } else {
        left.push_back(*before[slot]);
        if (const std::optional<size_t> taken = take()) holders_[*taken] = NewVehicle(*taken, next_id);
      }
      holders_[slot].reset();
    }
    ChooseWhoDrivesOff();
    Report(before, left);
  }

  const std::vector<ParkedVehicle>& report() const { return report_; }

 private:
  Vehicle NewVehicle(size_t slot, uint32_t& next_id) {
    const std::vector<uint32_t>& cars = street_.shared.cars;
    return {next_id++, cars[random_.Index(cars.size())], slot, false};
  }

  Pose PoseOf(size_t slot) const {
    const ParkingSlot& place = plan_.slots[slot];
    return street_.ground.OnWheelsAt(place.s, place.d, place.yaw, place.deck);
  }

  /// Cars at the right kerb, which can pull out into the lane beside them.
  void ChooseWhoDrivesOff() {
    std::vector<size_t> able;
    for (size_t slot = 0; slot < holders_.size(); ++slot) {
      if (holders_[slot].has_value() && plan_.slots[slot].at_kerb && plan_.slots[slot].d < 0) able.push_back(slot);
    }
    random_.Shuffle(able);
    able.resize(std::min(able.size(), static_cast<size_t>(street_.parameters.waiting_cars)));
    for (const size_t slot : able) holders_[slot]->drives_off = true;
  }

  void Report(const std::vector<std::optional<Vehicle>>& before, const std::vector<Vehicle>& left) {
    report_.clear();
    for (const std::optional<Vehicle>& vehicle : holders_) {
      if (!vehicle.has_value()) continue;
      const auto same = std::find_if(before.begin(), before.end(), [&](const std::optional<Vehicle>& other) {
        return other.has_value() && other->id == vehicle->id;
      });
      SceneObject object{.id = vehicle->id,
                         .kind = ObjectKind::kCar,
                         .state = ObjectState::kParked,
                         .mesh = vehicle->mesh,
                         .track = {{0, PoseOf(vehicle->slot)}}};
      if (same == before.end()) {
        object.state = ObjectState::kArrived;
      } else if ((*same)->slot != vehicle->slot) {
        object.state = ObjectState::kMoved;
        object.previous = PoseOf((*same)->slot);
      }
      report_.push_back({std::move(object), plan_.slots[vehicle->slot], vehicle->drives_off});
    }
    for (const Vehicle& vehicle : left) {
      report_.push_back({{.id = vehicle.id,
                          .kind = ObjectKind::kCar,
                          .state = ObjectState::kLeft,
                          .mesh = vehicle.mesh,
                          .track = {{0, PoseOf(vehicle.slot)}}},
                         plan_.slots[vehicle.slot],
                         false});
    }
  }

  const Street& street_;
  const StreetPlan& plan_;
  RandomStream random_;
  std::vector<std::optional<Vehicle>> holders_;  // one a slot
  std::vector<ParkedVehicle> report_;
};

/// The building site's state in a session, from its seed: it flips with half the rate of change.
std::optional<ObjectState> SiteState(uint64_t seed, int session, double change_rate) {
  RandomStream random(seed);
  bool built = random.Chance(kSiteTaken), built_before = built;
  for (int i = 0; i < session; ++i) {
    built_before = built;
    if (random.Chance(change_rate / 2)) built = !built;
  }
  if (built) return built_before ? ObjectState::kStanding : ObjectState::kBuilt;
  if (built_before) return ObjectState::kTornDown;
  return std::nullopt;
}

/// Nothing while it is not there and was not in the session before.
std::optional<ObjectState> StateOf(const PlannedObject& planned, int session) {
  const auto stands = [&](int at) {
    return at >= 0 && (!planned.from || at >= *planned.from) && (!planned.until || at < *planned.until);
  };
  // In the first session nothing is new.
  const bool now = stands(session), before = session == 0 ? now : stands(session - 1);
  if (now) return before ? ObjectState::kStanding : ObjectState::kBuilt;
  return before ? std::optional(ObjectState::kTornDown) : std::nullopt;
}

}  // namespace

Occupancy OccupancyOf(const Street& street, int session) {
  Occupancy occupancy;
  uint32_t next_id = street.next_id;
  for (const PlannedObject& planned : street.planned) {
    const std::optional<ObjectState> state = StateOf(planned, session);
    if (!state.has_value()) continue;
    occupancy.constructions.push_back(planned.object);
    occupancy.constructions.back().state = *state;
  }
  for (const StreetPlan& plan : street.ground.plans()) {
    for (size_t i = 0; i < plan.sites.size(); ++i, ++next_id) {
      const uint64_t seed = SeedOf(SeedOf(plan.seed, kSitePart), i);
      const std::optional<ObjectState> state = SiteState(seed, session, street.parameters.change_rate);
      if (!state.has_value()) continue;
      const std::vector<uint32_t>& shapes = street.shared.constructions;
      const BuildingSite& site = plan.sites[i];
      occupancy.constructions.push_back({.id = next_id,
                                         .kind = ObjectKind::kConstruction,
                                         .state = *state,
                                         .mesh = shapes[HashBits(seed) % shapes.size()],
                                         .track = {{0, street.ground.UprightAt(site.s, site.d, site.yaw)}}});
    }
  }
  std::vector<StreetSlots> streets;
  for (const StreetPlan& plan : street.ground.plans()) {
    streets.emplace_back(street, plan, streets.size()).Open(next_id);
  }
  for (int i = 0; i < session; ++i) {
    for (StreetSlots& slots : streets) slots.NextDay(next_id);
  }
  for (const StreetSlots& slots : streets) {
    const auto& report = slots.report();
    occupancy.vehicles.insert(occupancy.vehicles.end(), report.begin(), report.end());
  }
  occupancy.next_id = next_id;
  return occupancy;
}

}  // namespace mapkeep
