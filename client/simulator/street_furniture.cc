#include "client/simulator/street_furniture.h"

#include <cmath>

namespace mapkeep {
namespace {

using Eigen::Vector3f;

void AddScaffold(TriangleMesh& mesh, float half_length) {
  constexpr float kDepth = 1.0F, kLift = 2.0F;
  constexpr int kLifts = 3;
  for (float x = -half_length; x <= half_length + 0.01F; x += 2) {
    for (const float y : {-kDepth / 2, kDepth / 2}) {
      AddCone(mesh, {x, y, 0}, {x, y, kLifts * kLift + 1}, 0.03F, 0.03F, 6, Material::kMetal);
    }
  }
  for (int lift = 1; lift <= kLifts; ++lift) {
    const float z = kLift * static_cast<float>(lift);
    AddBox(mesh, {-half_length, -kDepth / 2, z}, {half_length, kDepth / 2, z + 0.05F}, Material::kWood);
    AddCone(mesh, {-half_length, -kDepth / 2, z + 0.9F}, {half_length, -kDepth / 2, z + 0.9F}, 0.03F, 0.03F, 6,
            Material::kMetal);
  }
}

}  // namespace

TriangleMesh MakeTree(uint64_t seed) {
  RandomStream random(seed);
  TriangleMesh mesh;
  const float trunk = random.UniformF(2.2, 3.2);
  const float crown = random.UniformF(1.4, 2.4);
  const float tall = crown * random.UniformF(1.0, 1.5);
  const float radius = random.UniformF(0.12, 0.24);
  const Vector3f fork(random.UniformF(-0.15, 0.15), random.UniformF(-0.15, 0.15), trunk);
  const Vector3f middle = fork + Vector3f(0, 0, tall);
  AddCone(mesh, {0, 0, -0.3F}, fork, radius, 0.8F * radius, 9, Material::kBark);
  AddCone(mesh, fork, middle, 0.75F * radius, 0.3F * radius, 7, Material::kBark);
  const int branches = 5 + static_cast<int>(random.Index(4));
  for (int i = 0; i < branches; ++i) {
    const float angle = 6.2832F * (static_cast<float>(i) + random.UniformF(0, 0.8)) / static_cast<float>(branches);
    const Vector3f from = fork + random.UniformF(0.0, 0.8) * tall * Vector3f(0, 0, 1);
    const Vector3f to = from + Vector3f(std::cos(angle), std::sin(angle), random.UniformF(0.4, 1.0)) * 0.6F * crown;
    AddCone(mesh, from, to, 0.3F * radius, 0.1F * radius, 5, Material::kBark);
    // Leaves grow in clusters at the branches: between them the crown is open.
    AddLeaves(mesh, to, Vector3f(0.5F, 0.5F, 0.4F) * crown, 55 + static_cast<int>(random.Index(40)), 0.11F, random);
  }
  AddLeaves(mesh, middle, {0.75F * crown, 0.75F * crown, 0.7F * tall}, 150, 0.12F, random);
  return mesh;
}

TriangleMesh MakeLampPost(uint64_t seed) {
  RandomStream random(seed);
  TriangleMesh mesh;
  const float height = random.UniformF(5.5, 7.5);
  AddCone(mesh, {0, 0, -0.3F}, {0, 0, 1.0F}, 0.11F, 0.11F, 9, Material::kMetal);
  AddCone(mesh, {0, 0, 1.0F}, {0, 0, height}, 0.08F, 0.05F, 9, Material::kMetal);
  AddCone(mesh, {0, 0, height - 0.1F}, {0, -1.4F, height + 0.2F}, 0.04F, 0.03F, 6, Material::kMetal);
  AddBox(mesh, {-0.12F, -1.9F, height + 0.12F}, {0.12F, -1.3F, height + 0.25F}, Material::kMetal);
  return mesh;
}

TriangleMesh MakeSign(uint64_t seed) {
  RandomStream random(seed);
  TriangleMesh mesh;
  const float height = random.UniformF(2.1, 2.6);
  const float half = random.UniformF(0.25, 0.4);
  AddCone(mesh, {0, 0, -0.3F}, {0, 0, height + half}, 0.035F, 0.035F, 7, Material::kMetal);
  // Signs face along the street.
  AddBox(mesh, {0.035F, -half, height - half}, {0.055F, half, height + half}, Material::kReflector);
  return mesh;
}

TriangleMesh MakeBollard(uint64_t seed) {
  RandomStream random(seed);
  TriangleMesh mesh;
  switch (random.Index(3)) {
    case 0:  // a bollard
      AddCone(mesh, {0, 0, -0.2F}, {0, 0, 0.95F}, 0.08F, 0.07F, 8, Material::kMetal);
      break;
    case 1:  // a bin
      AddCone(mesh, {0, 0, -0.2F}, {0, 0, 0.9F}, 0.25F, 0.28F, 10, Material::kMetal);
      break;
    default:  // a cabinet
      AddBox(mesh, {-0.4F, -0.18F, -0.2F}, {0.4F, 0.18F, 1.2F}, Material::kMetal);
  }
  return mesh;
}

TriangleMesh MakeBench(uint64_t /*seed*/) {
  TriangleMesh mesh;
  for (const float x : {-0.7F, 0.7F})
    AddBox(mesh, {x - 0.05F, -0.2F, -0.1F}, {x + 0.05F, 0.25F, 0.43F}, Material::kMetal);
  for (const float y : {-0.2F, -0.05F, 0.1F}) AddBox(mesh, {-0.9F, y, 0.43F}, {0.9F, y + 0.1F, 0.47F}, Material::kWood);
  for (const float z : {0.6F, 0.75F}) AddBox(mesh, {-0.9F, 0.22F, z}, {0.9F, 0.26F, z + 0.1F}, Material::kWood);
  return mesh;
}

TriangleMesh MakeFence(float length, uint64_t seed) {
  RandomStream random(seed);
  TriangleMesh mesh;
  const float height = random.UniformF(1.0, 1.5);
  const Material material = random.Chance(0.5) ? Material::kWood : Material::kMetal;
  const float picket = random.UniformF(0.03, 0.08), gap = random.UniformF(0.08, 0.13);
  for (const float z : {0.25F, height - 0.15F}) AddBox(mesh, {0, -0.02F, z}, {length, 0.02F, z + 0.06F}, material);
  for (float x = 0; x < length; x += picket + gap) {
    AddQuad(mesh, {x, 0, 0.05F}, {x + picket, 0, 0.05F}, {x + picket, 0, height}, {x, 0, height}, material);
  }
  for (float x = 0; x < length + 0.1F; x += 2.5F) {
    AddBox(mesh, {x - 0.05F, -0.05F, -0.8F}, {x + 0.05F, 0.05F, height + 0.05F}, material);
  }
  return mesh;
}

TriangleMesh MakeHedge(float length, uint64_t seed) {
  RandomStream random(seed);
  TriangleMesh mesh;
  const float height = random.UniformF(0.9, 1.5);
  AddBox(mesh, {0.05F, -0.18F, -0.8F}, {length - 0.05F, 0.18F, height - 0.25F}, Material::kLeaf);
  for (float x = 0.3F; x < length; x += 0.6F) {
    AddLeaves(mesh, {x, 0, height * 0.55F}, {0.45F, 0.4F, height * 0.5F}, 60, 0.07F, random);
  }
  return mesh;
}

TriangleMesh MakeConstruction(uint64_t seed) {
  RandomStream random(seed);
  TriangleMesh mesh;
  switch (random.Index(4)) {
    case 0: {  // a container, ribbed
      AddBox(mesh, {-2.0F, -0.75F, 0.1F}, {2.0F, 0.75F, 2.2F}, Material::kMetal);
      for (float x = -1.9F; x < 2; x += 0.4F)
        AddBox(mesh, {x, -0.8F, 0.15F}, {x + 0.15F, 0.8F, 2.15F}, Material::kMetal);
      break;
    }
    case 1:  // a kiosk
      AddBox(mesh, {-1.5F, -0.7F, -0.1F}, {1.5F, 0.8F, 2.3F}, Material::kWood);
      AddBox(mesh, {-1.7F, -1.1F, 2.3F}, {1.7F, 0.9F, 2.45F}, Material::kMetal);
      AddBox(mesh, {-1.2F, -0.95F, 0.95F}, {1.2F, -0.7F, 1.0F}, Material::kWood);
      break;
    case 2:  // a hoarding
      for (float x = -3; x < 3; x += 1.5F) {
        AddBox(mesh, {x + 0.01F, -0.02F, 0.05F}, {x + 1.49F, 0.02F, 2.0F}, Material::kWood);
        AddBox(mesh, {x - 0.05F, -0.3F, 0}, {x + 0.05F, 0.3F, 0.12F}, Material::kConcrete);
      }
      break;
    default:
      AddScaffold(mesh, 3);
  }
  return mesh;
}

}  // namespace mapkeep
