#include "client/simulator/mesh.h"

#include <cmath>
#include <numbers>

namespace mapkeep {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

Eigen::Vector3f AnyDirection(RandomStream& random) {
  const float z = random.UniformF(-1, 1);
  const float angle = random.UniformF(-kPi, kPi);
  const float r = std::sqrt(1 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

}  // namespace

float ReflectivityOf(Material material) {
  switch (material) {
    case Material::kAsphalt:
      return 0.17F;
    case Material::kPaving:
      return 0.28F;
    case Material::kGrass:
      return 0.45F;
    case Material::kPlaster:
      return 0.60F;
    case Material::kBrick:
      return 0.40F;
    case Material::kConcrete:
      return 0.35F;
    case Material::kWood:
      return 0.45F;
    case Material::kMetal:
      return 0.30F;
    case Material::kDarkPaint:
      return 0.10F;
    case Material::kBrightPaint:
      return 0.55F;
    case Material::kGlass:
      return 0.12F;
    case Material::kRubber:
      return 0.05F;
    case Material::kLeaf:
      return 0.50F;
    case Material::kBark:
      return 0.25F;
    case Material::kCloth:
      return 0.40F;
    case Material::kReflector:
      return 1.0F;
  }
  return 0;
}

void AddTriangle(TriangleMesh& mesh, const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
                 Material material) {
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.materials.push_back(material);
}

void AddQuad(TriangleMesh& mesh, const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
             const Eigen::Vector3f& d, Material material) {
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), {a, b, c, d});
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
  mesh.materials.insert(mesh.materials.end(), 2, material);
}

void AddBox(TriangleMesh& mesh, const Eigen::Vector3f& low, const Eigen::Vector3f& high, Material material) {
  const auto corner = [&](int i) {
    return Eigen::Vector3f((i & 1) != 0 ? high.x() : low.x(), (i & 2) != 0 ? high.y() : low.y(),
                           (i & 4) != 0 ? high.z() : low.z());
  };
  constexpr std::array<std::array<int, 4>, 6> kFaces = {
      {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}};
  for (const auto& f : kFaces) AddQuad(mesh, corner(f[0]), corner(f[1]), corner(f[2]), corner(f[3]), material);
}

void AddCone(TriangleMesh& mesh, const Eigen::Vector3f& foot, const Eigen::Vector3f& top, float foot_radius,
             float top_radius, int sides, Material material) {
  const Eigen::Vector3f axis = (top - foot).normalized();
  const Eigen::Vector3f u = axis.unitOrthogonal();
  const Eigen::Vector3f v = axis.cross(u);
  const auto around = [&](int i) {
    const float angle = 2 * kPi * static_cast<float>(i % sides) / static_cast<float>(sides);
    return Eigen::Vector3f(std::cos(angle) * u + std::sin(angle) * v);
  };
  for (int i = 0; i < sides; ++i) {
    const Eigen::Vector3f a = around(i), b = around(i + 1);
    AddQuad(mesh, foot + foot_radius * a, foot + foot_radius * b, top + top_radius * b, top + top_radius * a, material);
    AddTriangle(mesh, top + top_radius * a, top + top_radius * b, top, material);
  }
}

void AddProfile(TriangleMesh& mesh, std::span<const Eigen::Vector2f> profile, float half_width, float taper,
                Material skin, Material sides) {
  Eigen::Vector2f mean = Eigen::Vector2f::Zero();
  for (const Eigen::Vector2f& p : profile) mean += p / static_cast<float>(profile.size());
  const auto at = [&](const Eigen::Vector2f& p, float side) {
    const float inset = p.y() > mean.y() ? taper : 0;
    return Eigen::Vector3f(p.x(), side * (half_width - inset), p.y());
  };
  const auto middle = [&](float side) { return Eigen::Vector3f(mean.x(), side * (half_width - taper / 2), mean.y()); };
  for (size_t i = 0; i < profile.size(); ++i) {
    const Eigen::Vector2f &p = profile[i], &q = profile[(i + 1) % profile.size()];
    AddQuad(mesh, at(p, -1), at(q, -1), at(q, 1), at(p, 1), skin);
    for (const float side : {-1.0F, 1.0F}) AddTriangle(mesh, at(p, side), at(q, side), middle(side), sides);
  }
}

void AddLeaves(TriangleMesh& mesh, const Eigen::Vector3f& centre, const Eigen::Vector3f& radii, int count, float leaf,
               RandomStream& random) {
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3f direction = AnyDirection(random);
    const auto depth = static_cast<float>(std::pow(random.Uniform(), 0.22));
    const Eigen::Vector3f at = centre + depth * direction.cwiseProduct(radii);
    const Eigen::Vector3f normal = AnyDirection(random);
    const Eigen::Vector3f u = normal.unitOrthogonal();
    const Eigen::Vector3f v = normal.cross(u);
    const float size = leaf * random.UniformF(0.6, 1.4);
    AddTriangle(mesh, at + size * u, at - size * 0.5F * u + size * 0.8F * v, at - size * 0.5F * u - size * 0.8F * v,
                Material::kLeaf);
  }
}

void Append(TriangleMesh& mesh, const TriangleMesh& part, const Pose& pose) {
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  const Eigen::Isometry3f move = pose.cast<float>();
  for (const Eigen::Vector3f& v : part.vertices) mesh.vertices.push_back(move * v);
  for (const auto& t : part.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  mesh.materials.insert(mesh.materials.end(), part.materials.begin(), part.materials.end());
}

std::array<Eigen::Vector3f, 2> BoundsOf(const TriangleMesh& mesh) {
  if (mesh.vertices.empty()) return {Eigen::Vector3f::Zero(), Eigen::Vector3f::Zero()};
  std::array<Eigen::Vector3f, 2> bounds = {mesh.vertices.front(), mesh.vertices.front()};
  for (const Eigen::Vector3f& v : mesh.vertices) {
    bounds[0] = bounds[0].cwiseMin(v);
    bounds[1] = bounds[1].cwiseMax(v);
  }
  return bounds;
}

}  // namespace mapkeep
