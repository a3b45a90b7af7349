// registration_bench KITTI_DIR [CASES] [MAX_METRES] [MAX_DEGREES]
// Even frames make the map, odd frames are the session, moved by a random rigid motion a case. Prints the errors of the
// aligned scan poses against the given ones and the milliseconds a scan.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <random>

#include "core/ratio_map/session_map.h"
#include "core/registration/aligner.h"
#include "core/voxels/normal.h"
#include "tests/bench/kitti_directory.h"

namespace mapkeep {
namespace {

constexpr double kVoxel = 0.2;

// Every voxel that a point fell into; no exposures.
Evidence HitsOf(const ScanSource& scans, std::span<const Pose> poses) {
  std::vector<VoxelKey> keys;
  for (size_t i = 0; i < scans.count; ++i) {
    const auto scan = scans.read(i);
    for (const Eigen::Vector3f& point : scan->points) {
      keys.push_back(VoxelKeyOf(*VoxelIndexOf(poses[i] * point.cast<double>(), kVoxel)));
    }
    std::ranges::sort(keys);
    keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  }
  return {kVoxel, keys, std::vector<uint32_t>(keys.size(), 1), std::vector<uint32_t>(keys.size())};
}

RegistrationTarget TargetOf(const SessionMap& map) {
  RegistrationTarget target{.voxel_size = kVoxel};
  for (const SessionVoxel& voxel : map.voxels) {
    const Eigen::Vector3d inside(voxel.mean[0] + 0.5, voxel.mean[1] + 0.5, voxel.mean[2] + 0.5);
    target.points.push_back(CornerOf(VoxelIndexOf(voxel.key), kVoxel) + inside * (kVoxel / 256));
    target.normals.push_back(DecodeNormal(voxel.normal));
  }
  return target;
}

double Seconds(std::chrono::steady_clock::time_point since) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - since).count();
}

int Run(int count, char** arguments) {
  if (count < 2) {
    std::fprintf(stderr, "usage: registration_bench KITTI_DIR [CASES] [MAX_METRES] [MAX_DEGREES]\n");
    return 2;
  }
  const KittiDirectory directory(arguments[1]);
  const int cases = count > 2 ? std::atoi(arguments[2]) : 5;
  const double metres = count > 3 ? std::atof(arguments[3]) : 0.5;
  const double degrees = count > 4 ? std::atof(arguments[4]) : 2.0;

  std::vector<size_t> even, odd;
  std::vector<Pose> even_poses, odd_poses;
  for (size_t i = 0; i < directory.poses.size(); ++i) {
    (i % 2 == 0 ? even : odd).push_back(i);
    (i % 2 == 0 ? even_poses : odd_poses).push_back(directory.poses[i]);
  }
  const ScanSource even_scans = directory.Source(even), odd_scans = directory.Source(odd);
  const auto all_static = [](size_t, const Scan& scan) {
    return std::vector<PointLabel>(scan.points.size(), PointLabel::kStatic);
  };
  const Evidence evidence = HitsOf(even_scans, even_poses);
  const auto start = std::chrono::steady_clock::now();
  const auto map = BuildSessionMap(even_scans, even_poses, all_static, evidence, 0, {});
  if (!map.ok()) {
    std::fprintf(stderr, "%s\n", map.status().ToString().c_str());
    return 1;
  }
  std::printf("session map: %zu voxels, %.2f s\n", map->voxels.size(), Seconds(start));
  const auto found_start = std::chrono::steady_clock::now();
  const auto found = FoundMapFrame(even_scans, even_poses, {});
  std::printf("FoundMapFrame: %s, %.2f s\n", found->accepted ? "accepted" : found->reason.c_str(),
              Seconds(found_start));
  const RegistrationTarget target = TargetOf(*map);

  std::mt19937 random(1);
  std::normal_distribution<double> any;
  std::uniform_real_distribution<double> share(0, 1);
  for (int n = 0; n < cases; ++n) {
    const Eigen::Vector3d axis = Eigen::Vector3d(any(random), any(random), any(random)).normalized();
    const Eigen::Vector3d shift = Eigen::Vector3d(any(random), any(random), any(random)).normalized();
    // About the middle of the session, so that no pose is moved much further than the shift.
    const Eigen::Translation3d middle(odd_poses[odd_poses.size() / 2].translation());
    const Pose moved = Eigen::Translation3d(metres * share(random) * shift) * middle *
                       Eigen::AngleAxisd(degrees * share(random) * std::numbers::pi / 180, axis) * middle.inverse();
    std::vector<Pose> poses;
    for (const Pose& pose : odd_poses) poses.push_back(moved * pose);
    double worst_prior = 0;
    for (size_t i = 0; i < poses.size(); ++i) {
      worst_prior = std::max(worst_prior, (poses[i].translation() - odd_poses[i].translation()).norm());
    }
    const auto begin = std::chrono::steady_clock::now();
    const auto alignment = AlignSession(odd_scans, poses, target, {});
    const double seconds = Seconds(begin);
    if (!alignment.ok() || !alignment->accepted) {
      std::printf("case %d: %s\n", n,
                  alignment.ok() ? alignment->reason.c_str() : alignment.status().ToString().c_str());
      continue;
    }
    std::vector<double> errors, angles;
    for (size_t i = 0; i < poses.size(); ++i) {
      errors.push_back((alignment->poses[i].translation() - odd_poses[i].translation()).norm());
      angles.push_back(AngleBetween(alignment->poses[i], odd_poses[i]) * 180 / std::numbers::pi);
    }
    std::ranges::sort(errors);
    std::ranges::sort(angles);
    std::printf(
        "case %d: moved up to %.2f m; error median %.3f m %.3f deg, worst %.3f m %.3f deg; %.1f ms a scan; windows", n,
        worst_prior, errors[errors.size() / 2], angles[angles.size() / 2], errors.back(), angles.back(),
        1000 * seconds / static_cast<double>(poses.size()));
    for (const WindowResult& window : alignment->windows) {
      std::printf(" %u-%u:%s%.3f/%.3f", window.first_scan, window.last_scan, window.trusted ? "" : "!", window.fitness,
                  window.observability);
    }
    std::printf("\n");
  }
  return 0;
}

}  // namespace
}  // namespace mapkeep

int main(int count, char** arguments) { return mapkeep::Run(count, arguments); }
