#pragma once

#include <cstdint>
#include <vector>

namespace mapkeep {

// A street is planned in street coordinates: s metres along its centre line, d metres to the left of it.

inline constexpr double kStreetLength = 100;   ///< metres from one crossing to the next
inline constexpr double kCrossing = 14;        ///< metres of a street, at its start, that its crossing takes
inline constexpr double kLane = 1.65;          ///< |d| of a lane's middle; traffic keeps to the right
inline constexpr double kKerb = 5.4;           ///< |d| of the kerb
inline constexpr double kBuildingLine = 8.6;   ///< |d| at which pavements end and houses begin
inline constexpr double kBridgeClearance = 5;  ///< metres below the bridge

/// What lies beyond the pavement.
enum class LotKind : uint8_t {
  kHouse,
  kCarPark,   ///< open, two rows
  kCarDecks,  ///< a multi-storey car park
  kPark,      ///< grass that swells, trees, a fence
  kRamp,      ///< a drive that climbs between two houses
  kBridge,    ///< the foot of the bridge over the street
};

struct Lot {
  LotKind kind = LotKind::kHouse;
  int side = 1;               ///< 1: left (d > 0), -1: right
  double begin = 0, end = 0;  ///< s from the street's start, whole metres
  uint64_t seed = 0;
};

/// A place for one vehicle.
struct ParkingSlot {
  double s = 0, d = 0;  ///< s from the row's start
  double yaw = 0;       ///< radians from the direction of s
  double deck = 0;      ///< metres above the ground
  bool at_kerb = false;
};

/// A place where something may be built or torn down.
struct BuildingSite {
  double s = 0, d = 0;
  double yaw = 0;
};

/// One block of a street, from its seed alone.
struct StreetPlan {
  uint64_t seed = 0;
  double begin = 0;   ///< s of its start in the row
  double bridge = 0;  ///< s of the bridge's middle from the street's start
  std::vector<Lot> lots;
  std::vector<ParkingSlot> slots;
  std::vector<BuildingSite> sites;
};

StreetPlan PlanStreet(uint64_t seed, double begin);

/// The lot at `s` metres from the street's start on one side; null on a crossing.
const Lot* LotAt(const StreetPlan& plan, double s, int side);

}  // namespace mapkeep
