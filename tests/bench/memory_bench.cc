// Measures the memory that removal needs for sessions whose scans are generated while they are read: the peak for each
// --scans, the growth a scan between them, and what that makes of --extrapolate scans. Ends 1 if that is beyond
// --limit-gib.

#include <sys/resource.h>
#include <sys/wait.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>
#include <vector>

#include "client/simulator/random_stream.h"
#include "core/dor/remover.h"

namespace mapkeep {
namespace {

constexpr double kStep = 0.5;         // metres from scan to scan
constexpr double kHeight = 1.73;      // metres of the sensor above the ground
constexpr double kFacade = 9;         // metres from the middle of the street to the houses
constexpr double kPlot = 4;           // metres of facade of one depth
constexpr double kFacadeHeight = 14;  // metres
constexpr double kFarthest = 80;      // metres

/// How far a house stands back from the street's edge: every plot by itself.
double Recess(double x, bool left) {
  const auto plot = static_cast<int64_t>(std::floor(x / kPlot));
  return static_cast<double>(HashBits(static_cast<uint64_t>(2 * plot + (left ? 1 : 0))) % 1000) / 250;
}

/// The range of one ray from a sensor at (x, 0, kHeight) in a street along x without end: ground, and facades of plots
/// that stand back by up to 4 m. 0: none.
double RangeOf(double x, const Eigen::Vector3d& direction) {
  double range = direction.z() < 0 ? -kHeight / direction.z() : kFarthest;
  const double slope = std::abs(direction.y());
  if (slope * kFarthest > kFacade) {
    double facade = kFacade / slope;
    facade = (kFacade + Recess(x + facade * direction.x(), direction.y() > 0)) / slope;
    if (kHeight + facade * direction.z() < kFacadeHeight) range = std::min(range, facade);
  }
  return range < kFarthest ? range : 0;
}

/// A scan of 64 beams with `points` rays, a car of 4 m that drives ahead among them, with 2 cm of noise.
Scan ScanAt(size_t index, size_t points) {
  constexpr int kBeams = 64;
  const size_t firings = points / kBeams;
  RandomStream random(SeedOf(17, index));
  Scan scan;
  scan.points.reserve(points);
  const double x = kStep * static_cast<double>(index);
  const double turn = random.Uniform();
  for (size_t i = 0; i < firings; ++i) {
    const double azimuth = 2 * M_PI * (static_cast<double>(i) + turn) / static_cast<double>(firings);
    const double c = std::cos(azimuth), s = std::sin(azimuth);
    for (int beam = 0; beam < kBeams; ++beam) {
      const double elevation = (12 - 0.55 * beam) * M_PI / 180;
      const Eigen::Vector3d direction(std::cos(elevation) * c, std::cos(elevation) * s, std::sin(elevation));
      double range = RangeOf(x, direction);
      const double to_car = direction.x() > 0 ? 12 / direction.x() : kFarthest;
      const double car_y = to_car * direction.y(), car_z = kHeight + to_car * direction.z();
      if (std::abs(car_y) < 0.9 && car_z > 0.2 && car_z < 1.5) range = to_car;
      if (range == 0) continue;
      range += 0.02 * NormalFromBits(random.Bits());
      scan.points.emplace_back((range * direction).cast<float>());
    }
  }
  return scan;
}

struct Measured {
  double peak_mib = 0;
  RemovalReport report;
  double seconds = 0;
};

/// Cleans a session of so many scans and gives what it took. Runs in a process of its own, whose peak is its own.
std::optional<Measured> Measure(size_t scans, size_t points, int threads, double voxel_size) {
  int ends[2];
  if (pipe(ends) != 0) return std::nullopt;
  const pid_t child = fork();
  if (child == 0) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    std::vector<Pose> poses(scans, Pose::Identity());
    for (size_t i = 0; i < scans; ++i)
      poses[i].pretranslate(Eigen::Vector3d(kStep * static_cast<double>(i), 0, kHeight));
    const ScanSource source{scans, [&](size_t i) -> absl::StatusOr<Scan> { return ScanAt(i, points); }};
    DorParameters parameters;
    parameters.voxel_size = voxel_size;
    const auto removal = RemoveDynamicObjects(source, poses, {}, parameters);
    const bool written = removal.ok() && write(ends[1], &removal->report(), sizeof(RemovalReport)) > 0;
    if (!removal.ok()) std::fprintf(stderr, "%s\n", removal.status().ToString().c_str());
    _exit(written ? 0 : 1);
  }
  close(ends[1]);
  Measured measured;
  const auto begin = std::chrono::steady_clock::now();
  const bool reported = read(ends[0], &measured.report, sizeof(RemovalReport)) == sizeof(RemovalReport);
  close(ends[0]);
  int status = 0;
  rusage usage{};
  if (wait4(child, &status, 0, &usage) != child || status != 0 || !reported) return std::nullopt;
  measured.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  measured.peak_mib = static_cast<double>(usage.ru_maxrss) / 1024;
  return measured;
}

int Run(int argc, char** argv) {
  CLI::App app("Measures the memory of dynamic object removal");
  std::vector<size_t> counts = {100, 200};
  size_t points = 120'000, target = 10'000;
  int threads = 2;
  double voxel_size = 0.2, limit_gib = 6;
  app.add_option("--scans", counts, "lengths of sessions, ascending");
  app.add_option("--points", points, "rays a scan");
  app.add_option("--extrapolate", target, "scans to say the memory of");
  app.add_option("--limit-gib", limit_gib);
  app.add_option("--threads", threads);
  app.add_option("--voxel", voxel_size);
  CLI11_PARSE(app, argc, argv);
  std::printf("%8s%14s%12s%12s%12s%10s%14s\n", "scans", "points/scan", "voxels", "peak MiB", "KiB/scan", "B/voxel",
              "ms/scan");
  double peak = 0, slope = 0, last_scans = 0, last_voxels = 0;
  for (const size_t scans : counts) {
    const std::optional<Measured> measured = Measure(scans, points, threads, voxel_size);
    if (!measured.has_value()) return 1;
    const auto count = static_cast<double>(scans);
    const auto voxels = static_cast<double>(measured->report.voxels);
    slope = last_scans == 0 ? 0 : (measured->peak_mib - peak) / (count - last_scans);
    const double a_voxel = last_scans == 0 ? 0 : (measured->peak_mib - peak) * 1024 * 1024 / (voxels - last_voxels);
    peak = measured->peak_mib;
    last_scans = count;
    last_voxels = voxels;
    std::printf("%8zu%14.0f%12.0f%12.0f%12.1f%10.0f%14.1f\n", scans,
                static_cast<double>(ScanAt(0, points).points.size()), voxels, peak, slope * 1024, a_voxel,
                1000 * measured->seconds / count);
    std::fflush(stdout);
  }
  const double at_target = (peak + slope * std::max(0.0, static_cast<double>(target) - last_scans)) / 1024;
  std::printf("%zu scans: %.2f GiB of %.2f allowed\n", target, at_target, limit_gib);
  return at_target < limit_gib ? 0 : 1;
}

}  // namespace
}  // namespace mapkeep

int main(int argc, char** argv) { return mapkeep::Run(argc, argv); }
