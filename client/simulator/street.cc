#include "client/simulator/street.h"

#include <absl/strings/str_format.h>

#include <cmath>
#include <numbers>
#include <utility>

#include "client/simulator/building.h"
#include "client/simulator/random_stream.h"
#include "client/simulator/road_users.h"
#include "client/simulator/street_furniture.h"

namespace mapkeep {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kHouseDepth = 11;
constexpr int kMostStreets = 1000;

using Make = TriangleMesh (*)(uint64_t seed);

/// Collects meshes and what stands where.
class Builder {
 public:
  Builder(const Ground& ground, const StreetParameters& parameters)
      : ground_(ground), parameters_(parameters), level_(parameters.level) {
    const auto shelf = [&](Make make, size_t count) {
      std::vector<uint32_t> meshes;
      for (size_t i = 0; i < count; ++i) meshes.push_back(Add(make(SeedOf(parameters.seed, next_shape_++))));
      return meshes;
    };
    shared = {shelf(MakeCar, 12), shelf(MakeLorry, 3), shelf(MakeCyclist, 3), shelf(MakePedestrian, 8),
              shelf(MakeConstruction, 10)};
    trees_ = shelf(MakeTree, 12);
    lamps_ = shelf(MakeLampPost, 3);
    signs_ = shelf(MakeSign, 4);
    bollards_ = shelf(MakeBollard, 6);
    benches_ = shelf(MakeBench, 1);
  }

  void AddStreet(const StreetPlan& plan) {
    RandomStream random(SeedOf(plan.seed, 77));
    Stand(ObjectKind::kGround, Add(ground_.MeshOf(plan)), Pose(Eigen::Translation3d(ground_.PointAt(plan.begin, 0))));
    for (const Lot& lot : plan.lots) AddLot(plan, lot);
    AddBridge(plan);
    AddCrossing(plan, random);
    AddPavements(plan, random);
  }

  std::vector<TriangleMesh> meshes;
  std::vector<SceneObject> objects;
  std::vector<PlannedObject> planned;  ///< their ids are given at the end
  SharedMeshes shared;

 private:
  uint32_t Add(TriangleMesh mesh) {
    meshes.push_back(std::move(mesh));
    return static_cast<uint32_t>(meshes.size() - 1);
  }

  void Stand(ObjectKind kind, uint32_t mesh, const Pose& pose) {
    const auto id = static_cast<uint32_t>(objects.size() + 1);
    objects.push_back({.id = id, .kind = kind, .mesh = mesh, .track = {{0, pose}}});
  }

  /// Yaw of a thing whose front looks at the road.
  static double Facing(int side) { return side > 0 ? 0 : kPi; }

  void AddHouse(double s, double a, int side, double width, uint64_t seed) {
    Stand(ObjectKind::kBuilding, Add(MakeBuilding(static_cast<float>(width), kHouseDepth, seed)),
          ground_.UprightAt(s, side * a, Facing(side)));
  }

  /// A fence or hedge along the street from s to s + length.
  void AddAlong(ObjectKind kind, double s, double a, int side, double length, uint64_t seed) {
    // The mesh grows along its x, which on the right side of the street points back along s.
    const double from = side > 0 ? s : s + length;
    const auto metres = static_cast<float>(length);
    Stand(kind, Add(kind == ObjectKind::kFence ? MakeFence(metres, seed) : MakeHedge(metres, seed)),
          ground_.UprightAt(from, side * a, Facing(side)));
  }

  void AddTree(double s, double d, RandomStream& random) {
    Stand(ObjectKind::kTree, trees_[random.Index(trees_.size())], ground_.UprightAt(s, d, random.Uniform(-kPi, kPi)));
  }

  void AddLot(const StreetPlan& plan, const Lot& lot) {
    RandomStream random(lot.seed);
    const double begin = plan.begin + lot.begin, width = lot.end - lot.begin, middle = begin + width / 2;
    switch (lot.kind) {
      case LotKind::kHouse:
        AddHouse(middle, kBuildingLine + random.Uniform(0, 0.5), lot.side, width - 0.1, lot.seed);
        break;
      case LotKind::kRamp:
        AddHouse(middle, 31, lot.side, width + 2, lot.seed);
        break;
      case LotKind::kCarPark:
        AddAlong(ObjectKind::kHedge, begin + 6, kBuildingLine + 0.6, lot.side, width - 7, lot.seed);
        AddAlong(ObjectKind::kFence, begin + 1, 28, lot.side, width - 2, lot.seed);
        AddHouse(middle, 32, lot.side, width + 4, lot.seed);
        for (const double a : {17.5, 26.5}) AddTree(middle + random.Uniform(-6, 6), lot.side * a, random);
        break;
      case LotKind::kCarDecks:
        Stand(ObjectKind::kBuilding, Add(MakeCarDecks(static_cast<float>(width), 17.5F, 3.0F, 2)),
              ground_.UprightAt(middle, lot.side * (kBuildingLine + 0.3), Facing(lot.side)));
        break;
      case LotKind::kPark:
        AddAlong(ObjectKind::kFence, begin + 1, kBuildingLine + 0.3, lot.side, width - 6, lot.seed);
        if (plan.begin == ground_.plans().front().begin) PlanPark(begin, lot);
        AddHouse(middle, 34, lot.side, width + 4, lot.seed);
        for (int i = 0; i < 6; ++i) {
          AddTree(begin + width * (i + random.Uniform(0.2, 0.8)) / 6, lot.side * random.Uniform(11, 26), random);
        }
        AddAlong(ObjectKind::kHedge, begin + 2, 29, lot.side, width - 4, SeedOf(lot.seed, 1));
        Stand(ObjectKind::kFurniture, benches_[0], ground_.UprightAt(middle, lot.side * 10.5, Facing(lot.side)));
        break;
      case LotKind::kBridge:
        break;
    }
  }

  /// What is built and torn down in the park, once each.
  void PlanPark(double begin, const Lot& lot) {
    if (parameters_.fence_until.has_value()) {
      planned.push_back({.object = objects.back(), .from = {}, .until = parameters_.fence_until});
      objects.pop_back();
    }
    if (parameters_.extension_from.has_value()) {
      // A low annexe against the side of the house where the lot begins.
      constexpr float kHalf = 2.2F, kDeep = 5, kHigh = 3.2F;
      TriangleMesh mesh;
      AddBox(mesh, {-kHalf, 0, -1.5F}, {kHalf, kDeep, kHigh}, Material::kPlaster);
      AddBox(mesh, {-kHalf - 0.1F, -0.2F, kHigh}, {kHalf + 0.1F, kDeep + 0.1F, kHigh + 0.15F}, Material::kWood);
      planned.push_back(
          {.object = {.kind = ObjectKind::kBuilding,
                      .mesh = Add(std::move(mesh)),
                      .track = {{0, ground_.UprightAt(begin + kHalf + 0.1, lot.side * (kBuildingLine + 1.2),
                                                      Facing(lot.side))}}},
           .from = parameters_.extension_from,
           .until = {}});
    }
  }

  /// A deck across the street that comes down to the ground behind the houses' line.
  void AddBridge(const StreetPlan& plan) {
    constexpr float kHalf = 2.4F, kFlat = 12, kFoot = 40;
    TriangleMesh mesh;
    const auto under = static_cast<float>(kBridgeClearance), top = under + 0.6F;
    AddBox(mesh, {-kHalf, -kFlat, under}, {kHalf, kFlat, top}, Material::kConcrete);
    for (const float side : {-1.0F, 1.0F}) {
      const float x0 = side * kHalf, x1 = side * (kHalf - 0.15F);
      AddBox(mesh, {std::min(x0, x1), -kFlat, top}, {std::max(x0, x1), kFlat, top + 1}, Material::kMetal);
      const float a = side * kFlat, b = side * kFoot;
      AddQuad(mesh, {-kHalf, a, top}, {kHalf, a, top}, {kHalf, b, -0.2F}, {-kHalf, b, -0.2F}, Material::kConcrete);
      AddQuad(mesh, {-kHalf, a, under}, {kHalf, a, under}, {kHalf, b, -0.8F}, {-kHalf, b, -0.8F}, Material::kConcrete);
      for (const float x : {-kHalf, kHalf}) {
        AddQuad(mesh, {x, a, under}, {x, b, -0.8F}, {x, b, 0.8F}, {x, a, top + 1}, Material::kConcrete);
        AddBox(mesh, {x - 0.3F, side * 9 - 0.3F, -2}, {x + 0.3F, side * 9 + 0.3F, under}, Material::kConcrete);
      }
    }
    Stand(ObjectKind::kBridge, Add(std::move(mesh)), ground_.UprightAt(plan.begin + plan.bridge, 0, 0));
  }

  /// The cross street ends at houses on both sides; in a city it goes on.
  void AddCrossing(const StreetPlan& plan, RandomStream& random) {
    const double s = plan.begin + kCrossing / 2;
    const bool open = level_ && plan.begin >= 0 && plan.begin <= ground_.length();
    for (const int side : {1, -1}) {
      const uint64_t end = random.Bits();
      if (!open) AddHouse(s, 46, side, kCrossing + 6, end);
      for (const double offset : {-5.5, 5.5}) {
        const uint64_t corner = random.Bits();
        if (!open) AddHouse(s + offset * 2.2, 34, side, 9, corner);
        Stand(ObjectKind::kPole, signs_[random.Index(signs_.size())],
              ground_.UprightAt(s + offset, side * (kKerb + 0.5), side > 0 ? 0 : kPi));
      }
    }
  }

  void AddPavements(const StreetPlan& plan, RandomStream& random) {
    const auto is_open = [&](double along, int side) {
      const Lot* lot = LotAt(plan, along, side);
      return lot != nullptr && lot->kind != LotKind::kRamp && lot->kind != LotKind::kCarDecks &&
             lot->kind != LotKind::kBridge && !(lot->kind == LotKind::kCarPark && along < lot->begin + 6);
    };
    for (const int side : {1, -1}) {
      const double kerbside = side * (kKerb + 0.55);
      for (double along = kCrossing + random.Uniform(2, 5); along < kStreetLength - 2; along += random.Uniform(7, 11)) {
        if (!is_open(along, side)) continue;
        const double s = plan.begin + along;
        const double kind = random.Uniform();
        if (kind < 0.5) {
          AddTree(s, kerbside, random);
        } else if (kind < 0.7) {
          Stand(ObjectKind::kPole, lamps_[random.Index(lamps_.size())], ground_.UprightAt(s, kerbside, Facing(side)));
        } else if (kind < 0.85) {
          Stand(ObjectKind::kPole, signs_[random.Index(signs_.size())], ground_.UprightAt(s, kerbside, Facing(side)));
        } else {
          Stand(ObjectKind::kFurniture, bollards_[random.Index(bollards_.size())],
                ground_.UprightAt(s, kerbside, Facing(side)));
        }
      }
    }
  }

  const Ground& ground_;
  const StreetParameters& parameters_;
  const bool level_;
  uint64_t next_shape_ = 5000;
  std::vector<uint32_t> trees_, lamps_, signs_, bollards_, benches_;
};

absl::Status CheckParameters(const StreetParameters& parameters) {
  if (parameters.streets < 1 || parameters.streets > kMostStreets) {
    return absl::InvalidArgumentError(
        absl::StrFormat("streets is %d: expected 1 to %d", parameters.streets, kMostStreets));
  }
  if (parameters.waiting_cars < 0) {
    return absl::InvalidArgumentError(
        absl::StrFormat("waiting_cars is %d: expected 0 or more", parameters.waiting_cars));
  }
  const auto check_share = [](double value, const char* name) {
    if (value >= 0 && value <= 1) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrFormat("%s is %g: expected 0 to 1", name, value));
  };
  absl::Status status = check_share(parameters.occupancy, "occupancy");
  status.Update(check_share(parameters.change_rate, "change_rate"));
  return status;
}

}  // namespace

absl::StatusOr<StreetParts> BuildStreet(const StreetParameters& parameters) {
  if (absl::Status checked = CheckParameters(parameters); !checked.ok()) return checked;
  Ground ground(parameters.seed, parameters.streets, parameters.repeated, parameters.level);
  Builder builder(ground, parameters);
  for (const StreetPlan& plan : ground.plans()) builder.AddStreet(plan);
  return StreetParts{std::move(ground), std::move(builder.meshes), std::move(builder.shared),
                     std::move(builder.objects), std::move(builder.planned)};
}

absl::StatusOr<Street> MakeStreet(const StreetParameters& parameters) {
  absl::StatusOr<StreetParts> parts = BuildStreet(parameters);
  if (!parts.ok()) return parts.status();
  absl::StatusOr<RayCaster> caster = RayCaster::Create(std::move(parts->meshes));
  if (!caster.ok()) return caster.status();
  auto next_id = static_cast<uint32_t>(parts->fixed.size() + 1);
  for (PlannedObject& planned : parts->planned) planned.object.id = next_id++;
  return Street{parameters,
                std::move(parts->ground),
                *std::move(caster),
                std::move(parts->shared),
                std::move(parts->fixed),
                std::move(parts->planned),
                next_id};
}

}  // namespace mapkeep
