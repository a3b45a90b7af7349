#include "client/simulator/road_users.h"

namespace mapkeep {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

Material Paint(RandomStream& random) { return random.Chance(0.4) ? Material::kDarkPaint : Material::kBrightPaint; }

void AddWheel(TriangleMesh& mesh, float x, float y, float radius, float width) {
  AddCone(mesh, {x, y - width / 2, radius}, {x, y + width / 2, radius}, radius, radius, 10, Material::kRubber);
}

void AddWheels(TriangleMesh& mesh, float front, float rear, float half_width, float radius) {
  for (const float x : {front, rear}) {
    for (const float side : {-1.0F, 1.0F}) AddWheel(mesh, x, side * (half_width - 0.12F), radius, 0.2F);
  }
}

/// A leg, an arm, a neck.
void AddLimb(TriangleMesh& mesh, const Vector3f& from, const Vector3f& to, float radius) {
  AddCone(mesh, from, to, radius, 0.8F * radius, 6, Material::kCloth);
}

void AddHead(TriangleMesh& mesh, const Vector3f& centre) {
  AddCone(mesh, centre - Vector3f(0, 0, 0.12F), centre, 0.07F, 0.1F, 8, Material::kCloth);
  AddCone(mesh, centre, centre + Vector3f(0, 0, 0.12F), 0.1F, 0.05F, 8, Material::kCloth);
}

}  // namespace

TriangleMesh MakeCar(uint64_t seed) {
  RandomStream random(seed);
  TriangleMesh mesh;
  const bool van = random.Chance(0.15);
  const float length = van ? random.UniformF(4.8, 5.2) : random.UniformF(3.9, 4.8);
  const float height = van ? random.UniformF(1.85, 2.0) : random.UniformF(1.42, 1.62);
  const float half = random.UniformF(0.86, 0.94);
  const float front = length / 2, rear = -length / 2;
  const float waist = van ? 1.05F : 0.92F;
  const Material paint = Paint(random);
  const std::array<Vector2f, 9> body = {Vector2f{rear, 0.32F},  {rear + 0.02F, 0.75F},          {rear + 0.12F, waist},
                                        {front - 1.15F, waist}, {front - 0.25F, waist - 0.15F}, {front - 0.04F, 0.62F},
                                        {front, 0.34F},         {front - 0.3F, 0.2F},           {rear + 0.3F, 0.2F}};
  AddProfile(mesh, body, half, 0.04F, paint, paint);
  const float back = van || random.Chance(0.6) ? rear + 0.15F : rear + 0.75F;  // hatchback or saloon
  const std::array<Vector2f, 6> cabin = {Vector2f{back, waist},           {back + 0.25F, height - 0.08F},
                                         {back + 0.5F, height},           {front - 2.1F, height},
                                         {front - 1.75F, height - 0.08F}, {front - 1.05F, waist}};
  AddProfile(mesh, cabin, half - 0.05F, 0.12F, Material::kGlass, Material::kGlass);
  // The roof and its pillars are steel.
  AddBox(mesh, {back + 0.4F, -half + 0.17F, height}, {front - 2.0F, half - 0.17F, height + 0.02F}, paint);
  for (const float side : {-1.0F, 1.0F}) {
    for (const float x : {back + 0.1F, (back + front - 1.4F) / 2, front - 1.15F}) {
      const float lean = x < 0 ? 0.1F : -0.5F;
      AddCone(mesh, {x, side * (half - 0.05F), waist}, {x + (x > 0.2F ? lean : 0.05F), side * (half - 0.15F), height},
              0.05F, 0.05F, 4, paint);
    }
    const float mirror = side * (half + 0.08F);
    AddBox(mesh, {front - 1.5F, std::min(mirror, side * half), waist},
           {front - 1.35F, std::max(mirror, side * half), waist + 0.14F}, paint);
  }
  AddBox(mesh, {front - 0.01F, -0.26F, 0.42F}, {front + 0.01F, 0.26F, 0.53F}, Material::kReflector);
  AddBox(mesh, {rear - 0.01F, -0.26F, 0.6F}, {rear + 0.01F, 0.26F, 0.71F}, Material::kReflector);
  AddWheels(mesh, front - 0.85F, rear + 0.8F, half, 0.31F);
  return mesh;
}

TriangleMesh MakeLorry(uint64_t seed) {
  RandomStream random(seed);
  TriangleMesh mesh;
  const float length = random.UniformF(7, 10);
  const float height = random.UniformF(3.0, 3.7);
  const float front = length / 2, rear = -length / 2;
  const Material paint = Paint(random);
  AddBox(mesh, {rear, -1.25F, 1.0F}, {front - 2.2F, 1.25F, height}, Material::kBrightPaint);
  AddBox(mesh, {rear + 0.3F, -0.5F, 0.65F}, {front - 0.4F, 0.5F, 1.0F}, Material::kMetal);
  const std::array<Vector2f, 5> cab = {
      Vector2f{front - 2.0F, 0.5F}, {front - 2.0F, 2.7F}, {front - 0.3F, 2.7F}, {front, 1.6F}, {front, 0.45F}};
  AddProfile(mesh, cab, 1.2F, 0.05F, paint, paint);
  AddBox(mesh, {front - 0.2F, -1.0F, 1.75F}, {front - 0.1F, 1.0F, 2.5F}, Material::kGlass);
  for (const float x : {front - 1.2F, rear + 1.1F, rear + 2.3F}) {
    for (const float side : {-1.0F, 1.0F}) AddWheel(mesh, x, side * 1.05F, 0.48F, 0.3F);
  }
  return mesh;
}

TriangleMesh MakePedestrian(uint64_t seed) {
  RandomStream random(seed);
  TriangleMesh mesh;
  const float size = random.UniformF(1.55, 1.9) / 1.8F;
  const float stride = random.UniformF(0.15, 0.35);
  AddLimb(mesh, {stride, 0.1F, 0}, {0, 0.09F, 0.85F * size}, 0.08F);
  AddLimb(mesh, {-stride, -0.1F, 0}, {0, -0.09F, 0.85F * size}, 0.08F);
  AddCone(mesh, {0, 0, 0.8F * size}, {0, 0, 1.15F * size}, 0.16F, 0.2F, 8, Material::kCloth);
  AddCone(mesh, {0, 0, 1.15F * size}, {0, 0, 1.5F * size}, 0.2F, 0.12F, 8, Material::kCloth);
  AddLimb(mesh, {0, 0.22F, 1.42F * size}, {-stride * 0.8F, 0.26F, 0.85F * size}, 0.05F);
  AddLimb(mesh, {0, -0.22F, 1.42F * size}, {stride * 0.8F, -0.26F, 0.85F * size}, 0.05F);
  AddHead(mesh, {0, 0, 1.68F * size});
  if (random.Chance(0.3)) AddBox(mesh, {-0.32F, -0.15F, 1.0F * size}, {-0.14F, 0.15F, 1.45F * size}, Material::kCloth);
  return mesh;
}

TriangleMesh MakeCyclist(uint64_t seed) {
  RandomStream random(seed);
  TriangleMesh mesh;
  const float size = random.UniformF(0.93, 1.05);
  for (const float x : {0.52F, -0.52F}) {
    // A rim: thin enough that most rays pass between the spokes.
    constexpr int kParts = 10;
    for (int i = 0; i < kParts; ++i) {
      const auto at = [&](int k) {
        const float angle = 6.2832F * static_cast<float>(k) / kParts;
        return Vector3f(x + 0.34F * std::cos(angle), 0, 0.35F + 0.34F * std::sin(angle));
      };
      AddCone(mesh, at(i), at(i + 1), 0.025F, 0.025F, 4, Material::kRubber);
    }
  }
  AddCone(mesh, {0.5F, 0, 0.35F}, {0.35F, 0, 1.0F}, 0.025F, 0.025F, 5, Material::kMetal);
  AddCone(mesh, {0.4F, 0, 0.8F}, {-0.15F, 0, 0.85F}, 0.03F, 0.03F, 5, Material::kMetal);
  AddCone(mesh, {0.4F, 0, 0.75F}, {-0.05F, 0, 0.3F}, 0.03F, 0.03F, 5, Material::kMetal);
  AddCone(mesh, {-0.15F, 0, 0.9F}, {-0.52F, 0, 0.35F}, 0.025F, 0.025F, 5, Material::kMetal);
  AddCone(mesh, {0.38F, -0.25F, 1.0F}, {0.38F, 0.25F, 1.0F}, 0.02F, 0.02F, 5, Material::kMetal);
  AddLimb(mesh, {-0.15F, 0.1F, 0.95F}, {0.1F, 0.12F, 0.35F}, 0.08F);
  AddLimb(mesh, {-0.15F, -0.1F, 0.95F}, {0.2F, -0.12F, 0.6F}, 0.08F);
  AddCone(mesh, {-0.2F, 0, 0.92F}, {0.12F, 0, 1.48F * size}, 0.17F, 0.17F, 8, Material::kCloth);
  AddLimb(mesh, {0.1F, 0.18F, 1.4F * size}, {0.38F, 0.22F, 1.02F}, 0.05F);
  AddLimb(mesh, {0.1F, -0.18F, 1.4F * size}, {0.38F, -0.22F, 1.02F}, 0.05F);
  AddHead(mesh, {0.2F, 0, 1.66F * size});
  return mesh;
}

}  // namespace mapkeep
