// How often, how exactly and how fast the global matcher finds windows of odd scans in a map of even scans, under
// random rigid motions: matcher_bench DIR [--windows N] [--scans N] [--voxel V] [--threads N]. DIR is in the KITTI
// layout: velodyne/*.bin (x y z intensity, float32) and poses.txt (3x4 rows, scan to first).

#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <numbers>
#include <random>

#include "core/geometry/pose.h"
#include "core/registration/global_matcher.h"
#include "core/registration/pruning.h"
#include "core/registration/solver.h"

namespace mapkeep {
namespace {

struct Drive {
  std::vector<std::vector<Eigen::Vector3f>> scans;
  std::vector<Pose> poses;
};

Drive ReadDrive(const std::filesystem::path& folder) {
  Drive drive;
  std::ifstream poses(folder / "poses.txt");
  for (PoseRows rows; [&] {
         for (double& value : rows) {
           if (!(poses >> value)) return false;
         }
         return true;
       }();) {
    drive.poses.push_back(PoseFromRows(rows).value());
  }
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "velodyne")) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const auto& path : files) {
    std::vector<float> values(std::filesystem::file_size(path) / sizeof(float));
    std::ifstream(path, std::ios::binary)
        .read(reinterpret_cast<char*>(values.data()), std::streamsize(values.size() * sizeof(float)));
    auto& points = drive.scans.emplace_back();
    for (size_t i = 0; i + 3 < values.size(); i += 4) points.emplace_back(values[i], values[i + 1], values[i + 2]);
  }
  return drive;
}

// Scans [first, last) at every second place, in the frame `frame` (T_frame_first), with directions to the sensor.
// With `rings`, only points near the elevations of a 16-ring sensor (every 2 degrees), with noise along the ray.
FacingPoints Joined(const Drive& drive, size_t first, size_t count, const Pose& frame, double edge, bool rings = false,
                    double noise = 0) {
  FacingPoints all;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (size_t k = 0, i = first; k < count && i < drive.scans.size(); ++k, i += 2) {
    const Pose pose = frame * drive.poses[i];
    for (const auto& point : drive.scans[i]) {
      const double elevation = std::asin(point.z() / point.norm()) * 180 / std::numbers::pi;
      if (rings && std::abs(std::remainder(elevation - 1, 2)) > 0.1) continue;
      if (rings && std::abs(elevation) > 16) continue;
      const Eigen::Vector3d moved = pose * (point.cast<double>() * (1 + noise * normal(random) / point.norm()));
      all.points.push_back(moved);
      all.facing.emplace_back(pose.translation() - moved);
    }
  }
  if (edge <= 0) return all;
  // Thin as the windows of a session are.
  const MatchCloud thin = MakeMatchCloud(all, edge, 3);
  FacingPoints out;
  out.points = thin.points;
  for (const auto& n : thin.normals) out.facing.emplace_back(n.cast<double>());
  return out;
}

bool cpu = false;
double Seconds() {
  if (cpu) return double(std::clock()) / CLOCKS_PER_SEC;
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Copies of the map, each bent in its own way, so that none repeats another: a long street for the time of a match.
FacingPoints Street(const FacingPoints& map, int copies) {
  FacingPoints all;
  for (int c = 0; c < copies; ++c) {
    const double k = 0.11 + 0.013 * c;
    const double phase = 1.7 * c;
    for (size_t i = 0; i < map.points.size(); ++i) {
      Eigen::Vector3d p = map.points[i];
      Eigen::Vector3d f = map.facing[i];
      if (c > 0) {
        if (c % 2 == 1) {
          p.y() = -p.y();
          f.y() = -f.y();
        }
        p += Eigen::Vector3d(1.5 * std::sin(k * p.y() + phase), 1.5 * std::sin(k * p.x() + 2 * phase),
                             0.4 * std::sin(k * (p.x() - p.y())));
      }
      all.points.emplace_back(p + Eigen::Vector3d(150.0 * c, 0, 0));
      all.facing.push_back(f);
    }
  }
  return all;
}

int Run(int argc, char** argv) {
  std::string folder;
  int windows = 20;
  int scans = 20;
  int threads = 2;
  int copies = 1;
  double voxel = 0.5;
  bool rings = false;
  double noise = 0;
  size_t map_scans = 1000;
  double retry = 1.0;
  double map_edge = 0.2;
  double source_edge = 0.3;
  MatcherParameters parameters;
  CLI::App app("global matcher on a drive in the KITTI layout");
  app.add_option("folder", folder)->required();
  app.add_option("--windows", windows);
  app.add_option("--scans", scans);
  app.add_option("--voxel", voxel);
  app.add_option("--retry", retry);
  app.add_option("--threads", threads);
  app.add_option("--copies", copies);
  app.add_option("--map-edge", map_edge);
  app.add_option("--source-edge", source_edge);
  app.add_option("--ratio", parameters.matching.max_ratio);
  app.add_option("--matches", parameters.matching.max_matches);
  app.add_option("--queries", parameters.matching.max_queries);
  app.add_option("--probes", parameters.matching.probes);
  app.add_option("--flatness", parameters.max_flatness);
  app.add_flag("--cpu", cpu);
  app.add_option("--solver-bound", parameters.solver_bound);
  app.add_option("--graph-bound", parameters.graph_bound);
  app.add_option("--inlier-bound", parameters.inlier_bound);
  app.add_option("--normal-radius", parameters.normal_radius);
  app.add_option("--radius", parameters.descriptor_radius);
  app.add_option("--cores", parameters.max_cores);
  app.add_option("--min-inliers", parameters.min_inliers);
  app.add_flag("--rings", rings);
  app.add_option("--noise", noise);
  app.add_option("--map-scans", map_scans);
  app.add_option("--enough", parameters.enough_inliers);
  CLI11_PARSE(app, argc, argv);

  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  const Drive drive = ReadDrive(folder);
  const FacingPoints map = Street(Joined(drive, 0, map_scans, Pose::Identity(), map_edge), copies);
  std::vector<std::shared_ptr<const MatchTarget>> targets;
  for (const double v : {voxel, retry}) {
    const double start = Seconds();
    Features features = FeaturesOf(map, v, parameters);
    const double described = Seconds();
    targets.push_back(std::make_shared<MatchTarget>(std::move(features)));
    std::printf("target %.1f m: %zu points given, %zu features, described in %.3f s, indexed in %.3f s\n", v,
                map.points.size(), targets.back()->features.points.size(), described - start, Seconds() - described);
  }

  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1, 1);
  int found = 0;
  double describe_s = 0, match_s = 0, graph_s = 0, solve_s = 0, total_s = 0, worst = 0;
  std::vector<double> errors;
  for (int w = 0; w < windows; ++w) {
    const size_t last_first = drive.scans.size() - 2 * size_t(scans);
    const size_t first = 1 + 2 * ((size_t(w) * last_first / std::max(windows - 1, 1)) / 2);
    Pose motion = Pose::Identity();
    motion.linear() = Eigen::AngleAxisd(any(random) * std::numbers::pi, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    motion.translation() = Eigen::Vector3d(200 * any(random), 200 * any(random), 5 * any(random));
    const Pose truth = drive.poses[std::min(first, drive.poses.size() - 1)] * motion.inverse();
    const FacingPoints source =
        Joined(drive, first, scans, motion * drive.poses[first].inverse(), source_edge, rings, noise);

    double t0 = Seconds();
    const GlobalMatch match = MatchGlobally(source, targets, parameters);
    const double total = Seconds() - t0;
    total_s += total;
    worst = std::max(worst, total);

    t0 = Seconds();
    const Features features = FeaturesOf(source, voxel, parameters);
    double t1 = Seconds();
    describe_s += t1 - t0;
    const auto matches = MatchDescriptors(features.descriptors, targets[0]->features.descriptors, targets[0]->index,
                                          parameters.matching);
    double t2 = Seconds();
    match_s += t2 - t1;
    std::vector<PointPair> pairs;
    size_t right = 0;
    for (const Match& m : matches) {
      pairs.push_back({features.points[m.source], targets[0]->features.points[m.target]});
      right += (truth * pairs.back().source - pairs.back().target).norm() < 1.5 * voxel ? 1 : 0;
    }
    t2 = Seconds();
    const CompatibilityGraph graph(pairs, parameters.graph_bound * voxel);
    const auto core = LargestCore(graph, std::vector<uint8_t>(pairs.size(), 1));
    double t3 = Seconds();
    graph_s += t3 - t2;
    std::vector<PointPair> chosen;
    size_t right_core = 0;
    for (const uint32_t i : core) {
      chosen.push_back(pairs[i]);
      right_core += (truth * pairs[i].source - pairs[i].target).norm() < 1.5 * voxel ? 1 : 0;
    }
    (void)SolvePose(chosen, parameters.solver_bound * voxel, parameters.gnc_factor);
    solve_s += Seconds() - t3;

    double metres = 1e9, degrees = 180;
    size_t rank = 99;
    for (size_t c = 0; c < match.candidates.size(); ++c) {
      const double e =
          ((truth.inverse() * match.candidates[c].pose) * (motion.translation()) - motion.translation()).norm();
      const double d = AngleBetween(truth, match.candidates[c].pose) * 180 / std::numbers::pi;
      if (c == 0) metres = e, degrees = d;
      if (e < 0.5 && d < 3 && rank == 99) rank = c;
    }
    const bool good = rank == 0;
    found += good;
    errors.push_back(metres);
    std::printf(
        "window %2d first %2zu: %zu points %zu features %zu matches (%zu right) core %zu (%zu right) -> %s rank %zu "
        "inliers %zu at %.1f: %.3f m %.2f deg, %.3f s%s%s\n",
        w, first, source.points.size(), features.points.size(), matches.size(), right, core.size(), right_core,
        good ? "found" : "MISSED", rank, match.candidates.empty() ? 0 : match.candidates[0].inliers,
        match.candidates.empty() ? 0 : match.candidates[0].voxel_size, metres, degrees, total,
        match.reason.empty() ? "" : " ", match.reason.c_str());
  }
  std::sort(errors.begin(), errors.end());
  std::printf(
      "found %d of %d, median error %.3f m; a match %.3f s (worst %.3f): describe %.3f, match %.3f, graph and core "
      "%.3f, solve %.3f\n",
      found, windows, errors[errors.size() / 2], total_s / windows, worst, describe_s / windows, match_s / windows,
      graph_s / windows, solve_s / windows);
  return 0;
}

}  // namespace
}  // namespace mapkeep

int main(int argc, char** argv) { return mapkeep::Run(argc, argv); }
