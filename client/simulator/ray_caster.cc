#include "client/simulator/ray_caster.h"

#include <absl/strings/str_format.h>
#include <embree3/rtcore.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace mapkeep {
namespace {

constexpr size_t kPacket = 8;

struct ReleaseDevice {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct ReleaseScene {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using Device = std::unique_ptr<RTCDeviceTy, ReleaseDevice>;
using EmbreeScene = std::unique_ptr<RTCSceneTy, ReleaseScene>;

absl::Status ErrorOf(RTCDevice device) {
  const RTCError error = rtcGetDeviceError(device);
  if (error == RTC_ERROR_NONE) return absl::OkStatus();
  return absl::InternalError(absl::StrFormat("Embree reports error %d", static_cast<int>(error)));
}

absl::Status CheckMesh(const TriangleMesh& mesh, size_t index) {
  if (mesh.triangles.size() != mesh.materials.size()) {
    return absl::InvalidArgumentError(absl::StrFormat("mesh %d has %d materials for %d triangles", index,
                                                      mesh.materials.size(), mesh.triangles.size()));
  }
  for (const auto& triangle : mesh.triangles) {
    if (*std::max_element(triangle.begin(), triangle.end()) >= mesh.vertices.size()) {
      return absl::InvalidArgumentError(absl::StrFormat("mesh %d has a triangle beyond its vertices", index));
    }
  }
  return absl::OkStatus();
}

EmbreeScene SceneOf(RTCDevice device, const TriangleMesh& mesh) {
  EmbreeScene scene(rtcNewScene(device));
  // Watertight intersection: no ray slips between two triangles of a road.
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  if (!mesh.triangles.empty()) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                                 sizeof(Eigen::Vector3f), mesh.vertices.size()));
    auto* indices = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                   3 * sizeof(uint32_t), mesh.triangles.size()));
    if (vertices != nullptr && indices != nullptr) {
      for (const Eigen::Vector3f& v : mesh.vertices) vertices = std::copy_n(v.data(), 3, vertices);
      for (const auto& t : mesh.triangles) indices = std::copy_n(t.data(), 3, indices);
      rtcCommitGeometry(geometry);
      rtcAttachGeometry(scene.get(), geometry);
    }
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(scene.get());
  return scene;
}

bool SamePose(const Pose& a, const Pose& b) { return a.matrix() == b.matrix(); }

}  // namespace

struct RayCaster::State {
  Device device;
  std::vector<TriangleMesh> meshes;
  std::vector<EmbreeScene> scenes;       // one a mesh
  std::vector<Eigen::Vector3d> centres;  // of the sphere around each mesh
  std::vector<double> radii;
};

absl::StatusOr<RayCaster> RayCaster::Create(std::vector<TriangleMesh> meshes) {
  auto state = std::make_shared<State>();
  state->device.reset(rtcNewDevice(nullptr));
  if (state->device == nullptr) return absl::InternalError("Embree gives no device");
  for (const TriangleMesh& mesh : meshes) {
    if (absl::Status checked = CheckMesh(mesh, state->scenes.size()); !checked.ok()) return checked;
    state->scenes.push_back(SceneOf(state->device.get(), mesh));
    const auto [low, high] = BoundsOf(mesh);
    state->centres.emplace_back((0.5F * (low + high)).cast<double>());
    state->radii.push_back(0.5 * (high - low).norm());
  }
  state->meshes = std::move(meshes);
  if (absl::Status status = ErrorOf(state->device.get()); !status.ok()) return status;
  return RayCaster(std::move(state));
}

const std::vector<TriangleMesh>& RayCaster::meshes() const { return state_->meshes; }

absl::StatusOr<std::vector<RayHit>> RayCaster::Cast(std::span<const MeshInstance> instances, std::span<const Ray> rays,
                                                    float max_range) const {
  const State& state = *state_;
  EmbreeScene scene(rtcNewScene(state.device.get()));
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  for (size_t i = 0; i < instances.size(); ++i) {
    const MeshInstance& instance = instances[i];
    if (instance.mesh >= state.scenes.size()) {
      return absl::InvalidArgumentError(
          absl::StrFormat("instance %d asks for mesh %d of %d", i, instance.mesh, state.scenes.size()));
    }
    const double reach = state.radii[instance.mesh] + max_range;
    const Eigen::Vector3d& centre = state.centres[instance.mesh];
    if ((instance.begin * centre).norm() > reach && (instance.end * centre).norm() > reach) continue;
    const bool moves = !SamePose(instance.begin, instance.end);
    RTCGeometry geometry = rtcNewGeometry(state.device.get(), RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(geometry, state.scenes[instance.mesh].get());
    rtcSetGeometryTimeStepCount(geometry, moves ? 2 : 1);
    const std::array<const Pose*, 2> poses = {&instance.begin, &instance.end};
    for (unsigned step = 0; step < (moves ? 2U : 1U); ++step) {
      const Eigen::Matrix<float, 3, 4, Eigen::ColMajor> matrix = poses[step]->matrix().topRows<3>().cast<float>();
      rtcSetGeometryTransform(geometry, step, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, matrix.data());
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene.get(), geometry, static_cast<unsigned>(i));
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(scene.get());
  if (absl::Status status = ErrorOf(state.device.get()); !status.ok()) return status;

  std::vector<RayHit> hits(rays.size());
  const size_t packets = (rays.size() + kPacket - 1) / kPacket;
  tbb::parallel_for(tbb::blocked_range<size_t>(0, packets, 64), [&](const tbb::blocked_range<size_t>& range) {
    for (size_t packet = range.begin(); packet != range.end(); ++packet) {
      const size_t first = packet * kPacket;
      const size_t count = std::min(kPacket, rays.size() - first);
      alignas(32) std::array<int, kPacket> valid{};
      RTCRayHit8 query{};
      for (size_t k = 0; k < count; ++k) {
        const Ray& ray = rays[first + k];
        valid[k] = -1;
        query.ray.org_x[k] = ray.origin.x();
        query.ray.org_y[k] = ray.origin.y();
        query.ray.org_z[k] = ray.origin.z();
        query.ray.dir_x[k] = ray.direction.x();
        query.ray.dir_y[k] = ray.direction.y();
        query.ray.dir_z[k] = ray.direction.z();
        query.ray.tfar[k] = max_range;
        query.ray.time[k] = ray.time;
        query.ray.mask[k] = ~0U;
        query.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
        query.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
      }
      RTCIntersectContext context;
      rtcInitIntersectContext(&context);
      rtcIntersect8(valid.data(), scene.get(), &context, &query);
      for (size_t k = 0; k < count; ++k) {
        if (query.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) continue;
        const MeshInstance& instance = instances[query.hit.instID[0][k]];
        RayHit& hit = hits[first + k];
        hit.instance = query.hit.instID[0][k];
        hit.range = query.ray.tfar[k];
        hit.material = state.meshes[instance.mesh].materials[query.hit.primID[k]];
        // Embree gives the normal in the mesh's frame.
        const Eigen::Vector3f normal(query.hit.Ng_x[k], query.hit.Ng_y[k], query.hit.Ng_z[k]);
        const Eigen::Vector3f direction = instance.begin.linear().transpose().cast<float>() * rays[first + k].direction;
        const float length = normal.norm();
        hit.incidence = length > 0 ? std::min(1.0F, std::abs(normal.dot(direction)) / length) : 0;
      }
    }
  });
  return hits;
}

}  // namespace mapkeep
