#include "client/simulator/building.h"

#include <algorithm>
#include <cmath>

namespace mapkeep {
namespace {

using Eigen::Vector3f;

constexpr float kFootings = -2.5F;

/// Part of the front's plane, seen from the street.
struct Cell {
  float x0, x1, z0, z1;
};

/// A cell of the front with an opening whose pane lies `depth` behind the plane.
void AddOpening(TriangleMesh& mesh, const Cell& cell, const Cell& hole, float depth, Material wall, Material pane) {
  const auto at = [](float x, float y, float z) { return Vector3f(x, y, z); };
  const auto plane = [&](float x0, float x1, float z0, float z1, float y, Material material) {
    if (x1 > x0 && z1 > z0) AddQuad(mesh, at(x0, y, z0), at(x1, y, z0), at(x1, y, z1), at(x0, y, z1), material);
  };
  plane(cell.x0, hole.x0, cell.z0, cell.z1, 0, wall);
  plane(hole.x1, cell.x1, cell.z0, cell.z1, 0, wall);
  plane(hole.x0, hole.x1, cell.z0, hole.z0, 0, wall);
  plane(hole.x0, hole.x1, hole.z1, cell.z1, 0, wall);
  plane(hole.x0, hole.x1, hole.z0, hole.z1, depth, pane);
  for (const float x : {hole.x0, hole.x1}) {
    AddQuad(mesh, at(x, 0, hole.z0), at(x, depth, hole.z0), at(x, depth, hole.z1), at(x, 0, hole.z1), wall);
  }
  for (const float z : {hole.z0, hole.z1}) {
    AddQuad(mesh, at(hole.x0, 0, z), at(hole.x1, 0, z), at(hole.x1, depth, z), at(hole.x0, depth, z), wall);
  }
  // A cross in the window: frames send back what the glass swallows.
  if (pane == Material::kGlass) {
    const float middle = (hole.x0 + hole.x1) / 2;
    AddBox(mesh, {middle - 0.04F, depth - 0.04F, hole.z0}, {middle + 0.04F, depth - 0.01F, hole.z1}, Material::kWood);
    AddBox(mesh, {hole.x0, depth - 0.04F, hole.z1 - 0.5F}, {hole.x1, depth - 0.01F, hole.z1 - 0.42F}, Material::kWood);
  }
}

void AddBalcony(TriangleMesh& mesh, float x0, float x1, float z) {
  constexpr float kReach = 1.1F, kRail = 1.0F;
  AddBox(mesh, {x0, -kReach, z - 0.18F}, {x1, 0, z}, Material::kConcrete);
  AddBox(mesh, {x0, -kReach, z + kRail - 0.05F}, {x1, -kReach + 0.05F, z + kRail}, Material::kMetal);
  for (const float x : {x0, x1 - 0.05F})
    AddBox(mesh, {x, -kReach, z + kRail - 0.05F}, {x + 0.05F, 0, z + kRail}, Material::kMetal);
  for (float x = x0; x < x1; x += 0.15F) {
    AddQuad(mesh, {x, -kReach, z}, {x + 0.03F, -kReach, z}, {x + 0.03F, -kReach, z + kRail}, {x, -kReach, z + kRail},
            Material::kMetal);
  }
}

void AddRoof(TriangleMesh& mesh, float half, float depth, float height, bool gable) {
  if (!gable) {
    AddBox(mesh, {-half, -0.1F, height}, {half, 0.2F, height + 0.6F}, Material::kConcrete);
    AddQuad(mesh, {-half, 0, height}, {half, 0, height}, {half, depth, height}, {-half, depth, height},
            Material::kConcrete);
    return;
  }
  const float ridge = height + 0.35F * depth;
  const Vector3f left(-half, depth / 2, ridge), right(half, depth / 2, ridge);
  AddQuad(mesh, {-half, -0.35F, height - 0.15F}, {half, -0.35F, height - 0.15F}, right, left, Material::kBrick);
  AddQuad(mesh, {-half, depth, height}, {half, depth, height}, right, left, Material::kBrick);
  AddTriangle(mesh, {-half, 0, height}, {-half, depth, height}, left, Material::kPlaster);
  AddTriangle(mesh, {half, 0, height}, {half, depth, height}, right, Material::kPlaster);
}

void AddBody(TriangleMesh& mesh, float half, float depth, float height, Material wall) {
  for (const float x : {-half, half}) {
    AddQuad(mesh, {x, 0, kFootings}, {x, depth, kFootings}, {x, depth, height}, {x, 0, height}, wall);
  }
  AddQuad(mesh, {-half, depth, kFootings}, {half, depth, kFootings}, {half, depth, height}, {-half, depth, height},
          wall);
  AddQuad(mesh, {-half, 0, kFootings}, {half, 0, kFootings}, {half, 0, 0}, {-half, 0, 0}, wall);
}

}  // namespace

TriangleMesh MakeBuilding(float width, float depth, uint64_t seed) {
  RandomStream random(seed);
  TriangleMesh mesh;
  const float half = width / 2;
  const int storeys = 2 + static_cast<int>(random.Index(4));
  const float storey = random.UniformF(2.8, 3.4), ground = random.UniformF(3.0, 4.2);
  const float height = ground + storey * static_cast<float>(storeys - 1);
  const int bays = std::max(1, static_cast<int>(std::lround(width / random.Uniform(2.2, 3.4))));
  const float bay = width / static_cast<float>(bays);
  const float window = random.UniformF(0.4, 0.62) * bay, recess = random.UniformF(0.12, 0.28);
  const float sill = random.UniformF(0.4, 0.95), lintel = random.UniformF(0.3, 0.5);
  const Material wall = random.Chance(0.5) ? Material::kPlaster : Material::kBrick;
  const bool shop = random.Chance(0.35), balconies = random.Chance(0.45), bay_window = random.Chance(0.25);
  const size_t door = random.Index(static_cast<size_t>(bays));

  AddBody(mesh, half, depth, height, wall);
  AddRoof(mesh, half, depth, height, random.Chance(0.5));
  for (int floor = 0; floor < storeys; ++floor) {
    const float z0 = floor == 0 ? 0 : ground + storey * static_cast<float>(floor - 1);
    const float z1 = floor == 0 ? ground : z0 + storey;
    for (int i = 0; i < bays; ++i) {
      const float x0 = -half + bay * static_cast<float>(i), x1 = x0 + bay, middle = (x0 + x1) / 2;
      const Cell cell{x0, x1, z0, z1};
      if (floor == 0 && static_cast<size_t>(i) == door) {
        AddOpening(mesh, cell, {middle - 0.55F, middle + 0.55F, 0, 2.2F}, 0.35F, wall, Material::kWood);
        AddBox(mesh, {middle - 0.9F, -0.35F, kFootings}, {middle + 0.9F, 0, 0.14F}, Material::kConcrete);  // a step
      } else if (floor == 0 && shop) {
        AddOpening(mesh, cell, {x0 + 0.25F, x1 - 0.25F, 0.45F, 2.6F}, 0.3F, wall, Material::kGlass);
        AddQuad(mesh, {x0 + 0.1F, 0, 3.0F}, {x1 - 0.1F, 0, 3.0F}, {x1 - 0.1F, -1.2F, 2.5F}, {x0 + 0.1F, -1.2F, 2.5F},
                Material::kCloth);
      } else if (!random.Chance(0.06)) {
        const Cell hole{middle - window / 2, middle + window / 2, z0 + sill, z1 - lintel};
        AddOpening(mesh, cell, hole, recess, wall, Material::kGlass);
        AddBox(mesh, {hole.x0 - 0.08F, -0.07F, hole.z0 - 0.08F}, {hole.x1 + 0.08F, 0, hole.z0}, Material::kConcrete);
      } else {  // a blind bay
        AddQuad(mesh, {x0, 0, z0}, {x1, 0, z0}, {x1, 0, z1}, {x0, 0, z1}, wall);
      }
      if (floor > 0 && balconies && random.Chance(0.5)) AddBalcony(mesh, x0 + 0.15F, x1 - 0.15F, z0 + 0.1F);
    }
    if (floor > 0) AddBox(mesh, {-half, -0.09F, z0 - 0.08F}, {half, 0, z0 + 0.08F}, Material::kConcrete);  // a cornice
  }
  if (bay_window && storeys > 2) {
    AddBox(mesh, {-0.2F * width, -0.7F, ground}, {-0.2F * width + 2.2F, 0, ground + storey * 0.95F}, wall);
  }
  AddBox(mesh, {-half, -0.05F, kFootings}, {half, 0, 0.4F}, Material::kConcrete);  // the plinth
  AddCone(mesh, {half - 0.2F, -0.1F, 0}, {half - 0.2F, -0.1F, height}, 0.05F, 0.05F, 7, Material::kMetal);
  return mesh;
}

TriangleMesh MakeCarDecks(float width, float depth, float storey, int decks) {
  TriangleMesh mesh;
  const float half = width / 2;
  for (int deck = 1; deck <= decks; ++deck) {
    const float z = storey * static_cast<float>(deck);
    AddBox(mesh, {-half, 0, z - 0.28F}, {half, depth, z}, Material::kConcrete);
    AddBox(mesh, {-half, 0, z}, {half, 0.15F, z + 0.95F}, Material::kConcrete);
    for (const float x : {-half, half - 0.15F})
      AddBox(mesh, {x, 0, z}, {x + 0.15F, depth, z + 0.95F}, Material::kConcrete);
  }
  const float top = storey * static_cast<float>(decks);
  for (float x = -half + 0.3F; x < half; x += (width - 0.6F) / 4) {
    for (const float y : {0.3F, depth / 2, depth - 0.3F}) {
      AddBox(mesh, {x - 0.2F, y - 0.2F, kFootings}, {x + 0.2F, y + 0.2F, top - 0.28F}, Material::kConcrete);
    }
  }
  AddBox(mesh, {-half, depth - 0.1F, kFootings}, {half, depth + 0.1F, top + 1}, Material::kConcrete);
  AddBox(mesh, {half - 3.0F, depth - 4.0F, kFootings}, {half, depth, top + 3}, Material::kBrick);
  return mesh;
}

}  // namespace mapkeep
