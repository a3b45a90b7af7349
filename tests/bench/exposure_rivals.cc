#include "tests/bench/exposure_rivals.h"

#include <absl/container/flat_hash_map.h>
#include <absl/container/flat_hash_set.h>
#include <octomap/OcTree.h>
#include <octomap/Pointcloud.h>

#include <cstdlib>
#include <utility>

#include "core/voxels/ray_walk.h"
#include "core/voxels/voxel_index.h"

namespace mapkeep {
namespace {

/// Calls visit(from, first voxel, to, last voxel), in voxel edges, for every ray.
template <typename Visit>
void ForEachRay(const Scan& scan, const Pose& pose, double voxel_size, const Visit& visit) {
  const Eigen::Vector3d from = pose.translation() / voxel_size;
  const VoxelIndex first = *VoxelIndexOf(from, 1);
  for (const Eigen::Vector3f& point : scan.points) {
    const Eigen::Vector3d to = pose * point.cast<double>() / voxel_size;
    visit(from, first, to, *VoxelIndexOf(to, 1));
  }
}

}  // namespace

uint64_t CountByHashSets(std::span<const Scan> scans, std::span<const Pose> poses, double voxel_size) {
  absl::flat_hash_map<VoxelKey, std::pair<uint32_t, uint32_t>> counts;  // H, E
  for (size_t i = 0; i < scans.size(); ++i) {
    absl::flat_hash_set<VoxelKey> hit, passed;
    ForEachRay(
        scans[i], poses[i], voxel_size,
        [&](const Eigen::Vector3d& from, const VoxelIndex& first, const Eigen::Vector3d& to, const VoxelIndex& last) {
          for (RayWalk walk(from, first, to, last); !walk.done(); walk.Step()) {
            passed.insert(VoxelKeyOf(VoxelIndex{walk.at()[0], walk.at()[1], walk.at()[2]}));
          }
          hit.insert(VoxelKeyOf(last));
        });
    for (const VoxelKey key : hit) ++counts[key].first;
    for (const VoxelKey key : passed) {
      if (!hit.contains(key)) ++counts[key].second;
    }
  }
  return counts.size();
}

uint64_t InsertIntoOctomap(std::span<const Scan> scans, std::span<const Pose> poses, double voxel_size) {
  octomap::OcTree tree(voxel_size);
  for (size_t i = 0; i < scans.size(); ++i) {
    octomap::Pointcloud cloud;
    cloud.reserve(scans[i].points.size());
    for (const Eigen::Vector3f& point : scans[i].points) {
      const Eigen::Vector3f p = (poses[i] * point.cast<double>()).cast<float>();
      cloud.push_back(p.x(), p.y(), p.z());
    }
    const Eigen::Vector3f origin = poses[i].translation().cast<float>();
    tree.insertPointCloud(cloud, octomap::point3d(origin.x(), origin.y(), origin.z()));
  }
  return tree.getNumLeafNodes();
}

uint64_t VoxelStepsOf(std::span<const Scan> scans, std::span<const Pose> poses, double voxel_size) {
  uint64_t steps = 0;
  for (size_t i = 0; i < scans.size(); ++i) {
    ForEachRay(scans[i], poses[i], voxel_size,
               [&](const Eigen::Vector3d&, const VoxelIndex& first, const Eigen::Vector3d&, const VoxelIndex& last) {
                 steps += static_cast<uint64_t>(std::abs(last.x - first.x) + std::abs(last.y - first.y) +
                                                std::abs(last.z - first.z));
               });
  }
  return steps;
}

}  // namespace mapkeep
