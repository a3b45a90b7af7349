// Measures dynamic object removal on a KITTI directory (velodyne/*.bin, poses.txt, optional label/*.label): ms a scan
// without file reading, and the score against the labels.

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <type_traits>

#include "core/dor/exposure.h"
#include "core/dor/remover.h"
#include "core/dor/verdict.h"
#include "tests/bench/dor_comparison.h"
#include "tests/bench/dor_options.h"
#include "tests/bench/lap_clock.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr uint32_t kTrueStatic = 9;
constexpr uint32_t kTrueMoving = 251;

struct Drive {
  std::vector<Scan> scans;
  std::vector<Pose> poses;
  std::vector<std::vector<uint32_t>> truth;  // empty without labels
};

template <typename T>
std::vector<T> ReadAll(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::vector<T> values(fs::file_size(path) / sizeof(T));
  file.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(T)));
  return values;
}

Drive ReadDrive(const fs::path& directory, size_t first, size_t last) {
  Drive drive;
  std::ifstream poses(directory / "poses.txt");
  char name[16];
  for (size_t i = 0;; ++i) {
    PoseRows rows;
    for (double& value : rows) poses >> value;
    if (!poses || i > last) break;
    if (i < first) continue;
    drive.poses.push_back(PoseFromRows(rows).value());
    std::snprintf(name, sizeof name, "%06zu", i);
    const auto values = ReadAll<float>(directory / "velodyne" / (std::string(name) + ".bin"));
    Scan& scan = drive.scans.emplace_back();
    scan.time = 0.1 * static_cast<double>(i);
    for (size_t at = 0; at + 3 < values.size(); at += 4) {
      scan.points.emplace_back(values[at], values[at + 1], values[at + 2]);
    }
    const fs::path label = directory / "label" / (std::string(name) + ".label");
    if (fs::exists(label)) {
      drive.truth.push_back(ReadAll<uint32_t>(label));
      for (uint32_t& value : drive.truth.back()) value &= 0xffff;
    }
  }
  return drive;
}

struct Score {
  uint64_t statics = 0, kept = 0, moving = 0, removed = 0;
  std::map<int, std::array<uint64_t, 2>> by_range;  // 10 m rings: static points, those lost

  void Print() const {
    const double sa = 100.0 * kept / statics, da = 100.0 * removed / moving;
    std::printf("SA %.3f DA %.3f AA %.3f (lost %lu of %lu, left %lu of %lu)\n", sa, da, std::sqrt(sa * da),
                statics - kept, statics, moving - removed, moving);
    for (const auto& [ring, counts] : by_range) {
      std::printf("  %3d m: %8lu static, %6lu lost, %.2f %%\n", ring * 10, counts[0], counts[1],
                  100.0 * counts[1] / counts[0]);
    }
  }
};

// A labelled point, ready to be scored under any verdict.
struct ScoredPoint {
  uint32_t id = 0, point = 0;
  VoxelIndex voxel;
  float height = 0;
  bool moving = false;
};

struct Rates {
  double sa = 0, da = 0;
  double aa() const { return std::sqrt(sa * da); }
};

// The session counted once, for verdicts under several parameters.
class CountedDrive {
 public:
  CountedDrive(const Drive& drive, const ScanSource& source, const DorParameters& parameters)
      : drive_(drive),
        voxels_(CollectVoxels(source, drive.poses, parameters.voxel_size, {}, {}).value()),
        counts_(CountVoxels(source, drive.poses, parameters.voxel_size, voxels_, parameters.exposure, {}).value()) {
    for (size_t i = 0; i < drive.scans.size(); ++i) {
      for (size_t j = 0; j < drive.truth[i].size(); ++j) {
        const uint32_t truth = drive.truth[i][j];
        if (truth != kTrueStatic && truth != kTrueMoving) continue;
        const Eigen::Vector3d world = drive.poses[i] * drive.scans[i].points[j].cast<double>();
        const VoxelIndex voxel = VoxelIndexOf(world, parameters.voxel_size).value();
        points_.push_back({voxels_.grid.Find(voxel), static_cast<uint32_t>(j), voxel, static_cast<float>(world.z()),
                           truth == kTrueMoving});
      }
    }
  }

  Rates Score(const DorParameters& parameters) const {
    const Verdict verdict = Judge(voxels_, counts_, drive_.poses, parameters);
    double statics = 0, kept = 0, moving = 0, removed = 0;
    for (const ScoredPoint& point : points_) {
      const bool gone =
          LabelOf(verdict, point.id, point.voxel, point.height, point.point, parameters.seed) == PointLabel::kDynamic;
      (point.moving ? moving : statics) += 1;
      removed += point.moving && gone;
      kept += !point.moving && !gone;
    }
    return {100 * kept / statics, 100 * removed / moving};
  }

 private:
  const Drive& drive_;
  SessionVoxels voxels_;
  VoxelCounts counts_;
  std::vector<ScoredPoint> points_;
};

void PrintRates(const std::string& name, const Rates& rates) {
  std::printf("%-44s SA %.3f DA %.3f AA %.3f\n", name.c_str(), rates.sa, rates.da, rates.aa());
}

// How the score moves when a parameter moves by a third, one at a time, and without each refinement.
void PrintSensitivity(const Drive& drive, const ScanSource& source, const DorParameters& defaults, bool recount) {
  const CountedDrive counted(drive, source, defaults);
  PrintRates("defaults", counted.Score(defaults));
  const auto vary = [&](const char* name, auto DorParameters::*field) {
    for (const double factor : {2.0 / 3, 4.0 / 3}) {
      DorParameters changed = defaults;
      changed.*field = static_cast<std::remove_reference_t<decltype(changed.*field)>>(factor * (changed.*field) + 1e-9);
      PrintRates(std::string(name) + (factor < 1 ? " - 1/3" : " + 1/3"), counted.Score(changed));
    }
  };
  vary("eta", &DorParameters::eta);
  vary("stability_threshold", &DorParameters::stability_threshold);
  vary("ground_slope", &DorParameters::ground_slope);
  vary("ground_tolerance", &DorParameters::ground_tolerance);
  vary("ground_cell", &DorParameters::ground_cell);
  vary("ground_step", &DorParameters::ground_step);
  vary("candidate_threshold", &DorParameters::candidate_threshold);
  vary("cluster_radius", &DorParameters::cluster_radius);
  vary("cluster_min_neighbours", &DorParameters::cluster_min_neighbours);
  vary("cluster_threshold", &DorParameters::cluster_threshold);
  vary("confirm_reach", &DorParameters::confirm_reach);
  vary("doubt_hits", &DorParameters::doubt_hits);
  vary("doubt_returns", &DorParameters::doubt_returns);
  vary("doubt_stability", &DorParameters::doubt_stability);
  vary("doubt_voids", &DorParameters::doubt_voids);
  vary("vacated_scans", &DorParameters::vacated_scans);
  vary("vacated_neighbours", &DorParameters::vacated_neighbours);
  vary("vacated_confirmed", &DorParameters::vacated_confirmed);
  vary("departure_reach", &DorParameters::departure_reach);
  vary("setting_out", &DorParameters::setting_out);
  vary("transient_reach", &DorParameters::transient_reach);
  vary("transient_scans", &DorParameters::transient_scans);
  vary("transient_clear", &DorParameters::transient_clear);
  vary("decided_scans", &DorParameters::decided_scans);
  vary("surrounded_share", &DorParameters::surrounded_share);
  vary("surrounded_time", &DorParameters::surrounded_time);
  vary("surround_reach", &DorParameters::surround_reach);
  vary("ankle_tolerance", &DorParameters::ankle_tolerance);
  const auto without = [&](const char* name, bool DorParameters::*field) {
    DorParameters changed = defaults;
    changed.*field = false;
    PrintRates(std::string("without ") + name, counted.Score(changed));
  };
  without("protect_ground", &DorParameters::protect_ground);
  without("cluster", &DorParameters::cluster);
  without("confirm", &DorParameters::confirm);
  without("doubt", &DorParameters::doubt);
  without("departures", &DorParameters::departures);
  without("drive_offs", &DorParameters::drive_offs);
  without("transients", &DorParameters::transients);
  without("inherit", &DorParameters::inherit);
  without("surround", &DorParameters::surround);
  without("verify_ankles", &DorParameters::verify_ankles);
  without("restore", &DorParameters::restore);
  if (!recount) return;
  const auto again = [&](const char* name, const auto& change) {
    DorParameters changed = defaults;
    change(changed);
    PrintRates(name, CountedDrive(drive, source, changed).Score(changed));
  };
  again("voxel_size - 1/3", [](DorParameters& p) { p.voxel_size *= 2.0 / 3; });
  again("voxel_size + 1/3", [](DorParameters& p) { p.voxel_size *= 4.0 / 3; });
  again("exposure.margin_by_range - 1/3", [](DorParameters& p) { p.exposure.margin_by_range *= 2.0 / 3; });
  again("exposure.margin_by_range + 1/3", [](DorParameters& p) { p.exposure.margin_by_range *= 4.0 / 3; });
  again("exposure.clear_around - 1/3", [](DorParameters& p) { p.exposure.clear_around *= 2.0 / 3; });
  again("exposure.clear_around + 1/3", [](DorParameters& p) { p.exposure.clear_around *= 4.0 / 3; });
  again("exposure.clear_behind - 1/3", [](DorParameters& p) { p.exposure.clear_behind *= 2.0 / 3; });
  again("exposure.clear_behind + 1/3", [](DorParameters& p) { p.exposure.clear_behind *= 4.0 / 3; });
  again("without exposure.margin_by_range", [](DorParameters& p) { p.exposure.margin_by_range = 0; });
  again("without exposure.sub_voxels", [](DorParameters& p) { p.exposure.sub_voxels = false; });
  again("without exposure.neighbour_hits", [](DorParameters& p) { p.exposure.neighbour_hits = false; });
}

int Run(int argc, char** argv) {
  CLI::App app("Measures dynamic object removal on a KITTI directory");
  fs::path directory, out;
  DorParameters p;
  size_t first = 0, last = SIZE_MAX;
  int threads = 2, rounds = 1;
  bool compare = false, rings = false, sensitivity = false, recount = false;
  app.add_option("directory", directory)->required();
  app.add_option("--out", out, "write NNNNNN.label files here");
  app.add_option("--first", first);
  app.add_option("--last", last);
  app.add_option("--threads", threads);
  app.add_option("--rounds", rounds);
  app.add_flag("--sensitivity", sensitivity, "the score as each parameter moves by a third");
  app.add_flag("--recount", recount, "the same, also for the parameters that need the scans counted again");
  app.add_flag("--compare", compare, "beside the reference, hash sets and OctoMap; stages, bounds, growth");
  app.add_flag("--rings", rings, "losses by range");
  app.add_option("--voxel", p.voxel_size);
  AddDorOptions(app, p);
  CLI11_PARSE(app, argc, argv);

  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  const Drive drive = ReadDrive(directory, first, last);
  const auto scans = static_cast<double>(drive.scans.size());
  const ScanSource source = SourceOf(drive.scans);
  if (compare) {
    PrintComparison(drive.scans, drive.poses, p);
    return 0;
  }
  if (sensitivity || recount) {
    PrintSensitivity(drive, source, p, recount);
    return 0;
  }
  for (int round = 0; round < rounds; ++round) {
    LapClock clock;
    const auto voxels = CollectVoxels(source, drive.poses, p.voxel_size, {}, {});
    const Lap collect = clock.Next();
    const auto counts = CountVoxels(source, drive.poses, p.voxel_size, *voxels, p.exposure, {});
    const Lap count = clock.Next();
    const auto removal = RemoveDynamicObjects(source, drive.poses, {}, p);
    const Lap all = clock.Next();
    if (!removal.ok()) {
      std::fprintf(stderr, "%s\n", removal.status().ToString().c_str());
      return 1;
    }
    Score score;
    std::vector<std::vector<PointLabel>> labels(drive.scans.size());
    std::vector<LabelCounts> label_counts(drive.scans.size());
    tbb::parallel_for(size_t{0}, labels.size(),
                      [&](size_t i) { labels[i] = removal->Label(i, drive.scans[i], &label_counts[i]); });
    const Lap label = clock.Next();
    LabelCounts labelled;
    for (const LabelCounts& of_scan : label_counts) labelled.Add(of_scan);
    const RemovalReport& report = removal->report();
    const auto print_lap = [&](const char* name, const Lap& lap) {
      std::printf("%s %.2f (%.2f cpu)  ", name, lap.wall_ms / scans, lap.processor_ms / scans);
    };
    std::printf("ms a scan: ");
    print_lap("collect", collect);
    print_lap("count", count);
    print_lap("remove", all);
    print_lap("label", label);
    print_lap("in all", {all.wall_ms + label.wall_ms, all.processor_ms + label.processor_ms});
    std::printf("\nvoxels %lu dynamic %lu ground %lu removed %lu restored %lu\n", report.voxels, report.dynamic_voxels,
                report.ground_voxels, labelled.removed, labelled.restored);
    for (size_t i = 0; i < drive.scans.size(); ++i) {
      if (!out.empty()) {
        fs::create_directories(out);
        char name[24];
        std::snprintf(name, sizeof name, "%06zu.label", first + i);
        std::ofstream file(out / name, std::ios::binary);
        for (const PointLabel value : labels[i]) {
          const uint32_t word = value == PointLabel::kDynamic ? kTrueMoving : kTrueStatic;
          file.write(reinterpret_cast<const char*>(&word), sizeof word);
        }
      }
      if (drive.truth.empty()) continue;
      for (size_t j = 0; j < labels[i].size(); ++j) {
        const bool removed = labels[i][j] == PointLabel::kDynamic;
        if (drive.truth[i][j] == kTrueStatic) {
          ++score.statics;
          score.kept += !removed;
          auto& ring = score.by_range[static_cast<int>(drive.scans[i].points[j].norm() / 10)];
          ++ring[0];
          ring[1] += removed;
        } else if (drive.truth[i][j] == kTrueMoving) {
          ++score.moving;
          score.removed += removed;
        }
      }
    }
    if (!rings) score.by_range.clear();
    if (!drive.truth.empty()) score.Print();
  }
  return 0;
}

}  // namespace
}  // namespace mapkeep

int main(int argc, char** argv) { return mapkeep::Run(argc, argv); }
