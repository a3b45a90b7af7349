#include "client/simulator/parking.h"

#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <set>

namespace mapkeep {
namespace {

Street StreetWith(double change_rate, int waiting_cars = 0) {
  auto street = MakeStreet({.seed = 5, .streets = 2, .change_rate = change_rate, .waiting_cars = waiting_cars});
  EXPECT_TRUE(street.ok()) << street.status();
  return *std::move(street);
}

Eigen::Vector3d PlaceOf(const SceneObject& object) { return object.track.front().pose.translation(); }

/// What is there in a session, by id.
std::map<uint32_t, SceneObject> ThereIn(const Occupancy& occupancy) {
  std::map<uint32_t, SceneObject> there;
  for (const ParkedVehicle& vehicle : occupancy.vehicles) {
    if (IsThere(vehicle.object.state)) there.emplace(vehicle.object.id, vehicle.object);
  }
  return there;
}

TEST(Parking, AnExtensionIsBuiltOnceAndAFenceTornDownOnce) {
  const auto street = MakeStreet({.seed = 5, .change_rate = 0, .extension_from = 3, .fence_until = 5});
  ASSERT_TRUE(street.ok()) << street.status();
  ASSERT_EQ(street->planned.size(), 2U);
  for (int session = 0; session < 8; ++session) {
    std::map<uint32_t, ObjectState> states;
    for (const SceneObject& object : OccupancyOf(*street, session).constructions) states[object.id] = object.state;
    const auto state = [&](ObjectKind kind) -> std::optional<ObjectState> {
      for (const PlannedObject& planned : street->planned) {
        if (planned.object.kind != kind || !states.contains(planned.object.id)) continue;
        return states[planned.object.id];
      }
      return std::nullopt;
    };
    EXPECT_EQ(state(ObjectKind::kBuilding), session < 3    ? std::nullopt
                                            : session == 3 ? std::optional(ObjectState::kBuilt)
                                                           : std::optional(ObjectState::kStanding));
    EXPECT_EQ(state(ObjectKind::kFence), session < 5    ? std::optional(ObjectState::kStanding)
                                         : session == 5 ? std::optional(ObjectState::kTornDown)
                                                        : std::nullopt);
  }
}

TEST(Parking, EveryStateIsWhatTheTwoSessionsSay) {
  const Street street = StreetWith(0.4);
  for (int session = 1; session < 5; ++session) {
    const auto before = ThereIn(OccupancyOf(street, session - 1));
    const Occupancy occupancy = OccupancyOf(street, session);
    size_t left = 0, stayed = 0;
    for (const ParkedVehicle& vehicle : occupancy.vehicles) {
      const SceneObject& object = vehicle.object;
      const auto was = before.find(object.id);
      switch (object.state) {
        case ObjectState::kParked:
          ASSERT_NE(was, before.end());
          EXPECT_EQ(PlaceOf(was->second), PlaceOf(object));
          ++stayed;
          break;
        case ObjectState::kArrived:
          EXPECT_EQ(was, before.end());
          break;
        case ObjectState::kMoved:
          ASSERT_NE(was, before.end());
          EXPECT_GT((PlaceOf(was->second) - PlaceOf(object)).norm(), 2);
          EXPECT_EQ(PlaceOf(was->second), object.previous->translation());
          ++stayed;
          break;
        case ObjectState::kLeft:
          ASSERT_NE(was, before.end());
          EXPECT_EQ(PlaceOf(was->second), PlaceOf(object));
          ++left;
          break;
        default:
          FAIL() << "a vehicle is " << NameOf(object.state);
      }
    }
    EXPECT_GT(left, 0U);
    EXPECT_EQ(left + stayed, before.size()) << "everything that was there is accounted for";
  }
}

TEST(Parking, NobodyTakesAPlaceThatWasTakenTheDayBefore) {
  const Street street = StreetWith(0.6);
  const auto before = ThereIn(OccupancyOf(street, 0));
  for (const auto& [id, object] : ThereIn(OccupancyOf(street, 1))) {
    for (const auto& [other, was] : before) {
      if (id != other) {
        EXPECT_GT((PlaceOf(object) - PlaceOf(was)).norm(), 1.5);
      }
    }
  }
}

TEST(Parking, TheRateOfChangeIsTheShareThatIsElsewhere) {
  EXPECT_EQ(OccupancyOf(StreetWith(0), 3).vehicles.size(), ThereIn(OccupancyOf(StreetWith(0), 0)).size());
  const Street street = StreetWith(0.3);
  double changed = 0, all = 0;
  for (int session = 1; session <= 10; ++session) {
    for (const ParkedVehicle& vehicle : OccupancyOf(street, session).vehicles) {
      const ObjectState state = vehicle.object.state;
      if (state == ObjectState::kLeft || state == ObjectState::kMoved) ++changed;
      if (state != ObjectState::kArrived) ++all;
    }
  }
  EXPECT_NEAR(changed / all, 0.3, 0.04);
}

TEST(Parking, ACarThatDrivesOffIsSimplyAbsentTheNextDay) {
  const Street street = StreetWith(0, 2);
  std::set<uint32_t> drove_off;
  for (const ParkedVehicle& vehicle : OccupancyOf(street, 0).vehicles) {
    if (vehicle.drives_off) drove_off.insert(vehicle.object.id);
  }
  EXPECT_EQ(drove_off.size(), 2 * street.ground.plans().size());
  for (const ParkedVehicle& vehicle : OccupancyOf(street, 1).vehicles) {
    EXPECT_FALSE(drove_off.contains(vehicle.object.id));
  }
}

TEST(Parking, ThingsAreBuiltAndTornDown) {
  const Street street = StreetWith(0.6);
  std::set<ObjectState> seen;
  std::map<uint32_t, bool> stood;
  for (int session = 0; session < 6; ++session) {
    for (const SceneObject& object : OccupancyOf(street, session).constructions) {
      seen.insert(object.state);
      if (object.state == ObjectState::kTornDown) {
        EXPECT_TRUE(stood[object.id]);
      }
      if (object.state == ObjectState::kBuilt) {
        EXPECT_FALSE(stood[object.id]);
      }
      stood[object.id] = IsThere(object.state);
    }
  }
  EXPECT_EQ(seen, (std::set{ObjectState::kStanding, ObjectState::kBuilt, ObjectState::kTornDown}));
}

}  // namespace
}  // namespace mapkeep
