// registration_suite [--long] [--small] [--cases N --foreign N --repeated N] [--verbose]
// Sessions of simulated streets against maps of them: yaw 0-360 degrees, offset to 200 m, overlap 100 to 30 %, drift to
// 1 m per 100 m, 0-60 % of parked cars elsewhere, sensors other than the map's, noisy odometry; sessions from other
// streets, and from the middle of a street whose blocks are copies. Success: scan poses where the map was driven within
// 10 cm and 0.2 degrees RMS of the truth. Ends with status 1 if a session was accepted in a wrong place, a foreign one
// was accepted at all, or fewer than --least (98 %) of the overlapping ones succeeded.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <numbers>

#include "core/registration/query.h"
#include "core/registration/windows.h"
#include "tests/bench/registration_cases.h"

namespace mapkeep {
namespace {

constexpr double kDriven = 10;      // metres from a scan of the map within which a scan is judged
constexpr double kWrongMetres = 1;  // RMS error beyond which an accepted session lies in a wrong place
constexpr double kWrongDegrees = 2;

struct Errors {
  double metres = 0, degrees = 0;  // RMS
  std::vector<double> all_metres, all_degrees;
};

Errors ErrorsOf(const std::vector<Pose>& poses, const SuiteSession& session, const SuiteMap& map) {
  Errors errors;
  for (size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Vector3d place = session.truth[i].translation();
    const bool driven =
        std::ranges::any_of(map.poses, [&](const Pose& pose) { return (pose.translation() - place).norm() < kDriven; });
    if (!driven) continue;
    errors.all_metres.push_back((poses[i].translation() - place).norm());
    errors.all_degrees.push_back(AngleBetween(poses[i], session.truth[i]) * 180 / std::numbers::pi);
  }
  const auto rms = [](const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value * value;
    return std::sqrt(sum / static_cast<double>(std::max<size_t>(values.size(), 1)));
  };
  errors.metres = rms(errors.all_metres);
  errors.degrees = rms(errors.all_degrees);
  return errors;
}

double MedianOf(std::vector<double> values) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[values.size() / 2];
}

struct Tally {
  int cases = 0, succeeded = 0, wrong = 0, refused = 0;
  std::vector<double> metres, degrees, fused_metres, fused_degrees, seconds;
};

void Print(const Alignment& alignment) {
  for (const WindowResult& w : alignment.windows) {
    std::printf("    %u-%u: %s f %.2f p %.2f c %.2f o %.3f moved %.2f\n", w.first_scan, w.last_scan,
                w.trusted ? "trusted" : "-", w.fitness, w.precision, w.coverage, w.observability, w.correction);
  }
}

// How many windows the matcher's candidates hold the right place of, and at which rank.
void PrintRecall(const SuiteSession& session, const SuiteMap& map, const AlignParameters& parameters) {
  QueryBuilder queries(session.scans, session.poses, parameters.source_voxel, parameters.query_range);
  const std::vector<Window> windows = WindowsOf(session.poses, parameters);
  for (size_t u = 0; u < windows.size(); u += 3) {
    const FacingPoints query = queries.QueryOf(windows[u]).value();
    const auto targets = map.map.match_targets(query, {}).value();
    for (const auto& target : targets) {
      const auto match = MatchGlobally(query, std::span(&target, 1), parameters.matcher);
      size_t rank = 0;
      const Pose& truth = session.truth[windows[u].first];
      for (; rank < match.candidates.size(); ++rank) {
        const Pose& pose = match.candidates[rank].pose;
        if ((pose.translation() - truth.translation()).norm() < 2 && AngleBetween(pose, truth) < 0.1) break;
      }
      if (rank < match.candidates.size()) {
        std::printf(" %zu(%zu)", rank, match.candidates[rank].inliers);
      } else {
        std::printf(" -");
      }
    }
    std::printf(",");
  }
  std::printf("\n");
}

int Run(int count, char** arguments) {
  bool all = false, small = false, verbose = false, told = false, recall = false;
  size_t overlapping = 12, foreign = 3, repeated = 2;
  int only = -1;
  double least = 0.98;
  AlignParameters parameters;
  CLI::App app("registration suite");
  app.add_flag("--long", all);
  app.add_flag("--small", small);
  app.add_flag("--verbose", verbose);
  auto* given = app.add_option("--cases", overlapping);
  app.add_option("--foreign", foreign);
  app.add_option("--repeated", repeated);
  app.add_option("--least", least, "share of the overlapping cases that must succeed");
  app.add_option("--only", only, "number of one case");
  app.add_flag("--recall", recall, "only print the rank of the right place among the matcher's candidates");
  app.add_option("--queries", parameters.matcher.matching.max_queries);
  app.add_option("--radius", parameters.matcher.descriptor_radius);
  app.add_flag("--told", told, "give the true pose of the first scan as the prior");
  app.add_option("--flatness", parameters.matcher.max_flatness);
  app.add_option("--cores", parameters.matcher.max_cores);
  app.add_option("--ratio", parameters.matcher.matching.max_ratio);
  app.add_option("--normal-radius", parameters.matcher.normal_radius);
  app.add_option("--graph-bound", parameters.matcher.graph_bound);
  CLI11_PARSE(app, count, arguments);
  if (all && given->count() == 0) {
    overlapping = 100;
    foreign = 10;
    repeated = 5;
  }
  SuiteSize size;
  if (small) size = {.thinner = 4, .metres_per_scan = 2};

  std::map<std::string, Tally> tallies;
  std::map<std::pair<uint64_t, bool>, SuiteMap> maps;
  const std::vector<RegistrationCase> cases = SuiteCases(overlapping, foreign, repeated);
  std::printf(
      "case kind     sensor overlap yaw offset drift changed | verdict  rms m  deg | eq. 2 m  deg | trusted s\n");
  for (size_t i = 0; i < cases.size(); ++i) {
    if (only >= 0 && static_cast<size_t>(only) != i) continue;
    const RegistrationCase& of = cases[i];
    const auto key = std::pair(of.map_street, of.repeated);
    if (!maps.contains(key)) {
      if (maps.size() > 2) maps.clear();
      maps.emplace(key, MakeSuiteMap(of, size, parameters.matcher));
    }
    const SuiteMap& map = maps.at(key);
    const SuiteSession session = MakeSuiteSession(of, size, map, i);
    if (recall) {
      std::printf("%4zu %s overlap %.2f:", i, of.sensor.c_str(), of.overlap);
      PrintRecall(session, map, parameters);
      continue;
    }
    const auto began = std::chrono::steady_clock::now();
    std::optional<Pose> truth;
    if (told) truth = session.truth.front() * session.poses.front().inverse();
    const Alignment alignment = AlignSession(session.scans, session.poses, map.map, truth, parameters).value();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    Tally& tally = tallies[of.kind];
    ++tally.cases;
    tally.seconds.push_back(seconds);
    const auto trusted = std::ranges::count_if(alignment.windows, &WindowResult::trusted);
    std::printf("%4zu %-8s %-6s %4.2f %5.0f %6.0f %5.2f %5.2f   | ", i, of.kind.c_str(), of.sensor.c_str(), of.overlap,
                of.yaw, of.offset, of.drift, of.changed);
    if (!alignment.accepted) {
      ++tally.refused;
      std::printf("refused in %.1f s: %.*s\n", seconds, verbose ? 4000 : 160, alignment.reason.c_str());
    } else {
      const Errors errors = ErrorsOf(alignment.poses, session, map);
      AlignParameters fusion = parameters;
      fusion.scan_poses = ScanPoses::kFusion;
      const Pose prior = alignment.poses.front() * session.poses.front().inverse();
      const Alignment by_fusion = AlignSession(session.scans, session.poses, map.map, prior, fusion).value();
      const Errors fused = ErrorsOf(by_fusion.poses, session, map);
      const bool wrong = of.kind == "foreign" || errors.metres > kWrongMetres || errors.degrees > kWrongDegrees;
      const bool good = !wrong && errors.metres <= 0.1 && errors.degrees <= 0.2;
      tally.wrong += wrong ? 1 : 0;
      tally.succeeded += good ? 1 : 0;
      if (!wrong) {
        std::ranges::copy(errors.all_metres, std::back_inserter(tally.metres));
        std::ranges::copy(errors.all_degrees, std::back_inserter(tally.degrees));
        std::ranges::copy(fused.all_metres, std::back_inserter(tally.fused_metres));
        std::ranges::copy(fused.all_degrees, std::back_inserter(tally.fused_degrees));
      }
      std::printf("%-8s %.3f %.3f | %.3f %.3f | %ld of %zu, %.1f%s\n",
                  alignment.verdict == Verdict::kExtends ? "extends" : "aligned", errors.metres, errors.degrees,
                  fused.metres, fused.degrees, trusted, alignment.windows.size(), seconds,
                  wrong ? "  WRONG" : (good ? "" : "  OFF"));
    }
    if (verbose) Print(alignment);
    std::fflush(stdout);
  }
  bool passed = true;
  for (const auto& [kind, tally] : tallies) {
    std::printf("%s: %d cases, %d within 10 cm and 0.2 degrees, %d refused, %d accepted wrongly, median %.2f s\n",
                kind.c_str(), tally.cases, tally.succeeded, tally.refused, tally.wrong, MedianOf(tally.seconds));
    if (!tally.metres.empty()) {
      std::printf("  scan poses, median: pose graph %.3f m %.3f deg; the paper's fusion %.3f m %.3f deg\n",
                  MedianOf(tally.metres), MedianOf(tally.degrees), MedianOf(tally.fused_metres),
                  MedianOf(tally.fused_degrees));
    }
    passed = passed && tally.wrong == 0 && (kind != "overlap" || tally.succeeded >= least * tally.cases);
  }
  return passed ? 0 : 1;
}

}  // namespace
}  // namespace mapkeep

int main(int count, char** arguments) { return mapkeep::Run(count, arguments); }
