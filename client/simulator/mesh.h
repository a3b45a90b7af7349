#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "client/simulator/random_stream.h"
#include "core/geometry/pose.h"

namespace mapkeep {

/// What a surface is made of: how much of a pulse it sends back.
enum class Material : uint8_t {
  kAsphalt,
  kPaving,
  kGrass,
  kPlaster,
  kBrick,
  kConcrete,
  kWood,
  kMetal,
  kDarkPaint,
  kBrightPaint,
  kGlass,  ///< swallows most pulses
  kRubber,
  kLeaf,
  kBark,
  kCloth,
  kReflector,  ///< road signs, number plates
};

/// Share of the light that comes back at normal incidence, [0, 1]; near 905 nm, rounded from usual tables.
float ReflectivityOf(Material material);

/// Triangles, seen from both sides. Metres, the mesh's own frame.
struct TriangleMesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<Material> materials;  ///< one a triangle
};

void AddTriangle(TriangleMesh& mesh, const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
                 Material material);

/// Corners in order around.
void AddQuad(TriangleMesh& mesh, const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
             const Eigen::Vector3f& d, Material material);

/// An axis-aligned box between two corners, low <= high in every axis.
void AddBox(TriangleMesh& mesh, const Eigen::Vector3f& low, const Eigen::Vector3f& high, Material material);

/// A (truncated) cone around the line from `foot` to `top`, with `sides` faces, its top closed.
void AddCone(TriangleMesh& mesh, const Eigen::Vector3f& foot, const Eigen::Vector3f& top, float foot_radius,
             float top_radius, int sides, Material material);

/// A side view in (x, z), star-shaped around its mean, drawn out to y = -half_width .. half_width; the points in the
/// upper half of the profile are drawn in by `taper` metres a side.
void AddProfile(TriangleMesh& mesh, std::span<const Eigen::Vector2f> profile, float half_width, float taper,
                Material skin, Material sides);

/// `count` loose leaves (triangles about `leaf` metres wide, any direction) inside an ellipsoid, denser near its skin.
void AddLeaves(TriangleMesh& mesh, const Eigen::Vector3f& centre, const Eigen::Vector3f& radii, int count, float leaf,
               RandomStream& random);

/// Adds another mesh, moved by `pose`.
void Append(TriangleMesh& mesh, const TriangleMesh& part, const Pose& pose);

/// Corners of the smallest axis-aligned box around the mesh; both zero if it is empty.
std::array<Eigen::Vector3f, 2> BoundsOf(const TriangleMesh& mesh);

}  // namespace mapkeep
