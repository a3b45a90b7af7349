#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "client/simulator/mesh.h"
#include "core/geometry/pose.h"

namespace mapkeep {

/// A mesh somewhere, relative to the frame that the rays are given in; it goes from `begin` to `end` (on a straight
/// line) while a ray's time goes from 0 to 1.
struct MeshInstance {
  uint32_t mesh = 0;
  Pose begin = Pose::Identity();
  Pose end = Pose::Identity();
};

struct Ray {
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();
  Eigen::Vector3f direction = Eigen::Vector3f::UnitX();  ///< unit
  float time = 0;                                        ///< [0, 1]
};

/// The first surface that a ray meets.
struct RayHit {
  static constexpr uint32_t kNothing = ~uint32_t{0};
  uint32_t instance = kNothing;  ///< index into the instances, or kNothing
  float range = 0;               ///< metres
  float incidence = 0;           ///< |cosine| between the ray and the surface's normal
  Material material = Material::kAsphalt;
};

/// Meshes made ready for Embree once; what moves is an instance, given anew with each cast. Copies share the meshes.
class RayCaster {
 public:
  /// INVALID_ARGUMENT for a mesh whose columns do not fit each other, INTERNAL if Embree fails.
  static absl::StatusOr<RayCaster> Create(std::vector<TriangleMesh> meshes);

  /// One hit a ray, no farther than `max_range`. Instances out of reach of the frame's origin cost next to nothing.
  /// Safe from several threads at once; uses the calling oneTBB arena; the same on any number of threads.
  absl::StatusOr<std::vector<RayHit>> Cast(std::span<const MeshInstance> instances, std::span<const Ray> rays,
                                           float max_range) const;

  const std::vector<TriangleMesh>& meshes() const;

 private:
  struct State;
  explicit RayCaster(std::shared_ptr<const State> state) : state_(std::move(state)) {}
  std::shared_ptr<const State> state_;
};

}  // namespace mapkeep
