// Scores dynamic object removal on twelve simulated scenes (see removal_scenes.h) against the simulator's labels: SA,
// DA and AA a scene, their mean and worst, and what was missed: which kinds of things, how far they went, how far away.

#include <absl/strings/str_format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <string>
#include <vector>

#include "core/dor/pose_refinement.h"
#include "core/dor/remover.h"
#include "tests/bench/dor_options.h"
#include "tests/bench/removal_scenes.h"
#include "tests/bench/removal_score.h"
#include "tests/bench/scan_cache.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::vector<std::string> names;
  size_t scenes = SIZE_MAX, objects = 0;
  fs::path cache;
  int threads = 2;
  double voxel_size = 0;
  bool breakdown = false, exact_poses = false;
  DorParameters parameters;
};

double Percent(uint64_t part, uint64_t whole) {
  return whole == 0 ? 0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

// Lost: kept for what moved, removed for what did not.
uint64_t LostOf(const Fate& fate, bool moving) { return moving ? fate.points - fate.removed : fate.removed; }

std::string CellOf(const Fate& fate, bool moving) {
  if (fate.points == 0) return "-";
  return absl::StrFormat("%d (%.1f%%)", LostOf(fate, moving), Percent(LostOf(fate, moving), fate.points));
}

void PrintKinds(const std::map<std::string, KindFate>& kinds, bool moving) {
  std::printf("  %s, by kind; points lost (share of those there) by range and distance moved while seen\n",
              moving ? "moving things that stayed" : "static things that went");
  std::printf("  %-13s%9s%9s%8s%8s %16s%16s%16s%16s", "kind", "points", "lost", "share", "ground", "<10 m", "<20 m",
              "<40 m", "beyond");
  if (moving) std::printf(" |%16s%16s%16s", "moved <2 m", "<10 m", "farther");
  std::printf("\n");
  for (const auto& [name, kind] : kinds) {
    Fate all;
    for (const Fate& fate : kind.by_range) all.Add(fate);
    const uint64_t lost = LostOf(all, moving);
    std::printf("  %-13s%9lu%9lu%7.2f%%%8lu ", name.c_str(), all.points, lost, Percent(lost, all.points),
                moving ? all.kept_as_ground : 0);
    for (const Fate& fate : kind.by_range) std::printf("%16s", CellOf(fate, moving).c_str());
    if (moving) {
      std::printf(" |");
      for (const Fate& fate : kind.by_distance) std::printf("%16s", CellOf(fate, moving).c_str());
    }
    std::printf("\n");
  }
}

void PrintWorstObjects(const RemovalResult& result, size_t count) {
  std::vector<std::pair<uint64_t, uint32_t>> worst;
  for (const auto& [id, object] : result.objects) {
    if (object.IsUnsure()) continue;
    worst.emplace_back(LostOf(object.All(), object.labelled_moving), id);
  }
  std::sort(worst.rbegin(), worst.rend());
  worst.resize(std::min(worst.size(), count));
  std::printf("  %6s %-13s%-8s%9s%9s%9s%9s%9s  %s\n", "object", "kind", "truth", "moved m", "range m", "points", "lost",
              "ground", "seen in scans");
  for (const auto& [lost, id] : worst) {
    const SeenObject& object = result.objects.at(id);
    const Fate all = object.All();
    std::printf("  %6u %-13s%-8s%9.1f%9.1f%9lu%9lu%9lu  %zu-%zu\n", id, std::string(NameOf(object.kind)).c_str(),
                object.labelled_moving ? "moving" : "static", object.moved,
                object.range_sum / static_cast<double>(all.points), all.points, lost,
                object.labelled_moving ? all.kept_as_ground : 0, object.first_scan, object.last_scan);
  }
}

void AddKinds(std::map<std::string, KindFate>& sum, const std::map<std::string, KindFate>& kinds) {
  for (const auto& [name, kind] : kinds) {
    for (size_t i = 0; i < kind.by_range.size(); ++i) sum[name].by_range[i].Add(kind.by_range[i]);
    for (size_t i = 0; i < kind.by_distance.size(); ++i) sum[name].by_distance[i].Add(kind.by_distance[i]);
  }
}

class Suite {
 public:
  explicit Suite(const Options& options) : options_(options) {
    std::printf("%-40s%6s%7s%9s%9s%8s%8s%8s%8s%10s%9s\n", "scene", "voxel", "scans", "points", "moving", "SA", "DA",
                "AA", "unsure", "labels AA", "ms/scan");
  }

  absl::Status Run(const RemovalScene& scene) {
    absl::StatusOr<SimulatedSession> session = SimulateScene(scene);
    if (!session.ok()) return session.status();
    const fs::path file = options_.cache.empty() ? fs::path() : options_.cache / (scene.name + ".scans");
    absl::StatusOr<std::vector<LabelledScan>> truth =
        CachedScans(file, DescriptionOf(scene), scene.scans, session->labelled);
    if (!truth.ok()) return truth.status();

    DorParameters parameters = options_.parameters;
    parameters.voxel_size = options_.voxel_size > 0 ? options_.voxel_size : scene.voxel_size;
    for (size_t i = 0; i < truth->size(); ++i) (*truth)[i].scan.time = session->times[i];
    const ScanSource source = {truth->size(), [&](size_t i) -> absl::StatusOr<Scan> { return (*truth)[i].scan; }};
    const std::vector<Pose>& poses = options_.exact_poses ? session->truth : session->odometry;
    const auto begin = std::chrono::steady_clock::now();
    absl::StatusOr<std::vector<Pose>> refined = poses;
    if (parameters.refine_poses) refined = RefinePoses(source, poses, parameters.refinement);
    if (!refined.ok()) return refined.status();
    const absl::StatusOr<Removal> removal = RemoveDynamicObjects(source, *refined, {}, parameters);
    const auto end = std::chrono::steady_clock::now();
    if (!removal.ok()) return removal.status();
    std::vector<std::vector<PointLabel>> labels(truth->size());
    tbb::parallel_for(size_t{0}, labels.size(), [&](size_t i) { labels[i] = removal->Label(i, (*truth)[i].scan); });
    const RemovalResult result = ScoreRemoval(*session, *truth, labels);
    Print(scene, parameters.voxel_size, result,
          std::chrono::duration<double, std::milli>(end - begin).count() / static_cast<double>(truth->size()));
    scores_.push_back(result.score);
    AddKinds(moving_, FatesByKind(result, true));
    AddKinds(static_, FatesByKind(result, false));
    return absl::OkStatus();
  }

  void PrintSummary() const {
    if (scores_.empty()) return;
    const auto line = [&](const char* name, auto combine) {
      std::printf("%-80s", name);
      for (const auto& rate : {&RemovalScore::sa, &RemovalScore::da, &RemovalScore::aa}) {
        std::vector<double> values;
        for (const RemovalScore& score : scores_) values.push_back((score.*rate)());
        std::printf("%8.2f", combine(values));
      }
      std::printf("\n");
    };
    line("mean", [](const std::vector<double>& values) {
      double sum = 0;
      for (const double value : values) sum += value;
      return sum / static_cast<double>(values.size());
    });
    line("worst", [](const std::vector<double>& values) { return *std::min_element(values.begin(), values.end()); });
    std::printf("\n");
    PrintKinds(moving_, true);
    PrintKinds(static_, false);
  }

 private:
  void Print(const RemovalScene& scene, double voxel_size, const RemovalResult& result, double milliseconds) const {
    const RemovalScore& score = result.score;
    std::printf("%-40s%6.2f%7zu%8.2fM%8.2f%%%8.2f%8.2f%8.2f%7.2f%%%10.2f%9.1f\n", scene.name.c_str(), voxel_size,
                scene.scans, static_cast<double>(score.statics + score.moving + result.unsure) / 1e6,
                Percent(score.moving, score.statics + score.moving), score.sa(), score.da(), score.aa(),
                Percent(result.unsure, score.moving + result.unsure), result.as_labelled.aa(), milliseconds);
    if (options_.breakdown) {
      PrintKinds(FatesByKind(result, true), true);
      PrintKinds(FatesByKind(result, false), false);
    }
    if (options_.objects > 0) PrintWorstObjects(result, options_.objects);
    std::fflush(stdout);
  }

  const Options& options_;
  std::vector<RemovalScore> scores_;
  std::map<std::string, KindFate> moving_, static_;
};

int Run(int argc, char** argv) {
  CLI::App app("Scores dynamic object removal on simulated scenes");
  Options options;
  app.add_option("--scene", options.names, "only scenes whose name contains this; may be repeated");
  app.add_option("--scenes", options.scenes, "only the first N");
  app.add_option("--cache", options.cache, "directory in which simulated scans are kept from run to run");
  app.add_option("--threads", options.threads)->check(CLI::Range(1, 1024));
  app.add_option("--voxel", options.voxel_size, "metres, for all scenes; by default each has its own");
  app.add_flag("--breakdown", options.breakdown, "what was missed, for each scene");
  app.add_option("--objects", options.objects, "the N worst objects of each scene");
  app.add_flag("--exact-poses", options.exact_poses, "clean with the true poses");
  AddDorOptions(app, options.parameters);
  CLI11_PARSE(app, argc, argv);

  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, options.threads);
  std::vector<RemovalScene> scenes = RemovalScenes();
  scenes.resize(std::min(scenes.size(), options.scenes));
  const auto wanted = [&](const RemovalScene& scene) {
    return options.names.empty() ||
           std::any_of(options.names.begin(), options.names.end(),
                       [&](const std::string& name) { return scene.name.find(name) != std::string::npos; });
  };
  Suite suite(options);
  for (const RemovalScene& scene : scenes) {
    if (!wanted(scene)) continue;
    if (const absl::Status run = suite.Run(scene); !run.ok()) {
      std::fprintf(stderr, "%s: %s\n", scene.name.c_str(), run.ToString().c_str());
      return 1;
    }
  }
  suite.PrintSummary();
  return 0;
}

}  // namespace
}  // namespace mapkeep

int main(int argc, char** argv) { return mapkeep::Run(argc, argv); }
