#include "client/simulator/street_plan.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/simulator/random_stream.h"

namespace mapkeep {
namespace {

constexpr double kBridgeWidth = 8;
constexpr double kHouseWidth = 10;  // about
constexpr double kQuarterTurn = std::numbers::pi / 2;

struct Special {
  LotKind kind;
  double width;
};

/// Fills [begin, end) of one side with the given lots and houses between them.
void FillSide(StreetPlan& plan, int side, double begin, double end, const std::vector<Special>& specials,
              RandomStream& random) {
  double rest = end - begin;
  for (const Special& special : specials) rest -= special.width;
  const int houses = static_cast<int>(std::lround(rest / kHouseWidth));
  std::vector<Special> order(specials);
  for (int i = 0; i < houses; ++i) {
    const double width = std::floor(rest / (houses - i));
    order.push_back({LotKind::kHouse, width});
    rest -= width;
  }
  random.Shuffle(order);
  double s = begin;
  for (size_t i = 0; i < order.size(); ++i) {
    const double next = i + 1 == order.size() ? end : s + order[i].width;
    plan.lots.push_back({order[i].kind, side, s, next, random.Bits()});
    s = next;
  }
}

bool IsDriveway(const StreetPlan& plan, double s, int side) {
  const Lot* lot = LotAt(plan, s, side);
  return lot != nullptr && (lot->kind == LotKind::kRamp || lot->kind == LotKind::kCarDecks ||
                            (lot->kind == LotKind::kCarPark && s < lot->begin + 5));
}

void AddKerbSlots(StreetPlan& plan, RandomStream& random) {
  for (const int side : {1, -1}) {
    for (double s = kCrossing + 5; s < kStreetLength - 4; s += 5.6) {
      if (IsDriveway(plan, s - 1.5, side) || IsDriveway(plan, s + 1.5, side)) continue;
      plan.slots.push_back({plan.begin + s + random.Uniform(-0.3, 0.3),
                            side * (kKerb - 1.05 + random.Uniform(-0.08, 0.08)),
                            (side > 0 ? std::numbers::pi : 0) + random.Uniform(-0.03, 0.03), 0, true});
    }
  }
}

void AddLotSlots(StreetPlan& plan, RandomStream& random) {
  for (const Lot& lot : plan.lots) {
    const bool decks = lot.kind == LotKind::kCarDecks;
    if (lot.kind != LotKind::kCarPark && !decks) continue;
    for (double s = lot.begin + (decks ? 2.2 : 6.5); s < lot.end - (decks ? 5.0 : 1.5); s += 2.6) {
      for (const double a : {13.0, 22.0}) {
        for (int deck = 0; deck < (decks ? 2 : 1); ++deck) {
          const double nose = random.Chance(0.5) ? kQuarterTurn : -kQuarterTurn;
          plan.slots.push_back({plan.begin + s + random.Uniform(-0.15, 0.15),
                                lot.side * (a + random.Uniform(-0.3, 0.3)), nose + random.Uniform(-0.04, 0.04),
                                3.0 * deck, false});
        }
      }
    }
  }
}

}  // namespace

StreetPlan PlanStreet(uint64_t seed, double begin) {
  RandomStream random(seed);
  StreetPlan plan{.seed = seed, .begin = begin};
  const double bridge = 38 + static_cast<double>(random.Index(30));
  plan.bridge = bridge + kBridgeWidth / 2;
  const bool mirrored = random.Chance(0.5);
  for (const int side : {1, -1}) {
    std::vector<Special> specials = (side > 0) != mirrored
                                        ? std::vector<Special>{{LotKind::kCarPark, 24}, {LotKind::kRamp, 5}}
                                        : std::vector<Special>{{LotKind::kPark, 22}, {LotKind::kCarDecks, 20}};
    random.Shuffle(specials);
    // One before the bridge and one behind it, the larger one where there is more room.
    const bool first_is_large = bridge - kCrossing > kStreetLength - bridge - kBridgeWidth;
    if ((specials[0].width > specials[1].width) != first_is_large) std::swap(specials[0], specials[1]);
    FillSide(plan, side, kCrossing, bridge, {specials[0]}, random);
    plan.lots.push_back({LotKind::kBridge, side, bridge, bridge + kBridgeWidth, random.Bits()});
    FillSide(plan, side, bridge + kBridgeWidth, kStreetLength, {specials[1]}, random);
  }
  AddKerbSlots(plan, random);
  AddLotSlots(plan, random);
  for (const int side : {1, -1}) {
    for (const double s : {24.0, 57.0, 84.0}) {
      plan.sites.push_back(
          {begin + s + random.Uniform(-6, 6), side * (kBuildingLine - 0.9), side > 0 ? 0 : std::numbers::pi});
    }
  }
  return plan;
}

const Lot* LotAt(const StreetPlan& plan, double s, int side) {
  for (const Lot& lot : plan.lots) {
    if (lot.side == side && s >= lot.begin && s < lot.end) return &lot;
  }
  return nullptr;
}

}  // namespace mapkeep
