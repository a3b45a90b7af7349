#include "tests/bench/dor_comparison.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <vector>

#include "core/dor/exposure.h"
#include "core/dor/remover.h"
#include "core/dor/scan_loop.h"
#include "core/dor/verdict.h"
#include "tests/bench/exposure_rivals.h"
#include "tests/bench/hardware_counters.h"
#include "tests/bench/lap_clock.h"

namespace mapkeep {
namespace {

ScanSource SourceOver(std::span<const Scan> scans) {
  return {scans.size(), [scans](size_t i) -> absl::StatusOr<Scan> { return scans[i]; }};
}

Lap MeasureRemoval(std::span<const Scan> scans, std::span<const Pose> poses, const DorParameters& parameters) {
  LapClock clock;
  const auto removal = RemoveDynamicObjects(SourceOver(scans), poses, {}, parameters);
  if (!removal.ok()) {
    std::fprintf(stderr, "%s\n", removal.status().ToString().c_str());
    std::exit(1);
  }
  return clock.Next();
}

void PrintScaling(std::span<const Scan> scans, std::span<const Pose> poses, const DorParameters& parameters) {
  std::printf("\ngrowth with scans, removal in all, whole sessions from the start\n");
  const auto line = [](int times, const char* what, double count, const Lap& lap, const Lap& first) {
    std::printf("  %dx %12.0f %-7s wall %9.1f ms, processor %9.1f ms, %5.2fx the 1x, %8.1f us cpu a thousand %s\n",
                times, count, what, lap.wall_ms, lap.processor_ms, lap.processor_ms / first.processor_ms,
                1e6 * lap.processor_ms / count, what);
  };
  Lap first;
  for (const size_t times : {1, 2, 4, 8}) {
    const size_t count = scans.size() * times / 8;
    if (count == 0) continue;
    const Lap lap = MeasureRemoval(scans.first(count), poses.first(count), parameters);
    if (times == 1) first = lap;
    line(static_cast<int>(times), "scans", static_cast<double>(count), lap, first);
  }
  std::printf("growth with points, every 8th, 4th, 2nd point and all, same scans\n");
  for (const size_t times : {1, 2, 4, 8}) {
    std::vector<Scan> thinned(scans.size());
    double points = 0;
    for (size_t i = 0; i < scans.size(); ++i) {
      for (size_t k = 0; k < scans[i].points.size(); k += 8 / times) thinned[i].points.push_back(scans[i].points[k]);
      points += static_cast<double>(thinned[i].points.size());
    }
    const Lap lap = MeasureRemoval(thinned, poses, parameters);
    if (times == 1) first = lap;
    line(static_cast<int>(times), "points", points, lap, first);
  }
}

}  // namespace

void PrintComparison(std::span<const Scan> scans, std::span<const Pose> poses, const DorParameters& parameters) {
  const HardwareCounters counters;  // before oneTBB's threads
  const ScanSource source = SourceOver(scans);
  const auto count = static_cast<double>(scans.size());
  const double size = parameters.voxel_size;
  double points = 0;
  for (const Scan& scan : scans) points += static_cast<double>(scan.points.size());
  const auto print = [&](const char* name, const Lap& lap, double whole) {
    std::printf("  %-34s%9.2f ms a scan%9.2f cpu  %6.1f%%\n", name, lap.wall_ms / count, lap.processor_ms / count,
                100 * lap.processor_ms / whole);
  };

  // Stages.
  std::ignore = CollectVoxels(source, poses, size, {}, {});  // pages and threads are there afterwards
  const std::optional<HardwareCounts> before = counters.Now();
  LapClock clock;
  const auto voxels = CollectVoxels(source, poses, size, {}, {});
  const Lap collect = clock.Next();
  const auto counted = CountVoxels(source, poses, size, *voxels, parameters.exposure, {});
  const Lap counting = clock.Next();
  const std::optional<HardwareCounts> after = counters.Now();
  clock.Next();
  const Verdict verdict = Judge(*voxels, *counted, poses, parameters);
  const Lap judge = clock.Next();
  const Lap all = MeasureRemoval(scans, poses, parameters);
  std::printf("stages at %.2f m, %zu scans of %.0f points\n", size, scans.size(), points / count);
  print("collect", collect, all.processor_ms);
  print("count", counting, all.processor_ms);
  print("judge", judge, all.processor_ms);
  const Lap rest{all.wall_ms - collect.wall_ms - counting.wall_ms - judge.wall_ms,
                 all.processor_ms - collect.processor_ms - counting.processor_ms - judge.processor_ms};
  print("label, evidence, copies of scans", rest, all.processor_ms);
  print("all", all, all.processor_ms);

  // Rivals.
  const Lap ours{collect.wall_ms + counting.wall_ms, collect.processor_ms + counting.processor_ms};
  std::printf("\ncounting exposures, processor time against ours (collect + count)\n");
  const auto rival = [&](const char* name, const Lap& lap) {
    std::printf("  %-34s%9.2f ms a scan%9.2f cpu  %6.1fx\n", name, lap.wall_ms / count, lap.processor_ms / count,
                lap.processor_ms / ours.processor_ms);
    std::fflush(stdout);
  };
  rival("ours", ours);
  ExposureParameters exact = parameters.exposure;
  exact.engine = ExposureEngine::kRayWalk;
  clock.Next();
  std::ignore = CollectVoxels(source, poses, size, {}, {});
  std::ignore = CountVoxels(source, poses, size, *voxels, exact, {});
  rival("exact reference (ray walk)", clock.Next());
  const uint64_t touched = CountByHashSets(scans, poses, size);
  rival("plain hash-set DDA, one thread", clock.Next());
  const uint64_t leaves = InsertIntoOctomap(scans, poses, size);
  rival("OctoMap insertPointCloud, one thread", clock.Next());
  std::printf("  voxels: ours %lu, hash sets %lu, OctoMap leaves %lu\n",
              static_cast<unsigned long>(voxels->masks.size()), static_cast<unsigned long>(touched),
              static_cast<unsigned long>(leaves));

  // Bounds.
  const auto steps = static_cast<double>(VoxelStepsOf(scans, poses, size));
  clock.Next();
  for (size_t i = 0; i < scans.size(); ++i) {
    std::vector<VoxelIndex> at;
    std::vector<Eigen::Vector3d> positions;
    std::ignore = VoxelsOfScan(scans[i], poses[i], size, at, positions);
  }
  const Lap floor = clock.Next();
  std::printf("\nbounds, a scan: %.0f rays, %.0f voxel steps if every ray is walked, %.1f ns cpu a ray, ",
              points / count, steps / count, 1e6 * ours.processor_ms / points);
  if (before.has_value() && after.has_value()) {
    const auto part = [&](auto field) { return static_cast<double>((*after).*field - (*before).*field); };
    std::printf("%.2f instructions a cycle, %.2f cache misses a ray; ",
                part(&HardwareCounts::instructions) / part(&HardwareCounts::cycles),
                part(&HardwareCounts::cache_misses) / points);
  } else {
    std::printf("cache misses not available here; ");
  }
  std::printf("finding every point's voxel once takes %.2f ms cpu, so we are %.1fx above that floor\n",
              floor.processor_ms / count, ours.processor_ms / floor.processor_ms);
  PrintScaling(scans, poses, parameters);
}

}  // namespace mapkeep
