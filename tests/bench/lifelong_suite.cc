// How well a map follows a street that changes: sessions on consecutive days in which parked cars come and go, an
// extension is built and a fence taken away. After each day the static map is scored against that day's truth, and the
// changes that it tells against the true ones; the decay of eq. 8 beside no decay, and beside the last session alone.

#include <absl/strings/str_format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "client/simulator/random_stream.h"
#include "client/simulator/street_session.h"
#include "core/dor/pose_refinement.h"
#include "server/pipeline/outline.h"
#include "server/pipeline/stages.h"
#include "storage/map_diff.h"
#include "storage/rocksdb_engine.h"
#include "tests/bench/dor_options.h"
#include "tests/bench/lifelong_breakdown.h"
#include "tests/bench/lifelong_truth.h"
#include "tests/bench/scan_cache.h"

namespace mapkeep {
namespace {

constexpr uint32_t kMinutesADay = 1440;
constexpr uint32_t kFirstMinute = 13'889'280;  // 2026-06-01 since 2000

struct Options {
  StreetParameters street{.seed = 11, .change_rate = 0.4, .extension_from = 3, .fence_until = 5};
  DriveParameters drive{.scans = 160, .speed = 6, .odometry = {.drift = 0.5}};
  std::string sensor = "os1-64";
  int sessions = 10;
  bool align = true;
  bool only_decay = false;
  bool list = false;
  bool breakdown = false;
  std::string cache;
  double least_sa = 0;  ///< percent, after every day; the exit status says whether all were reached
  double least_da = 0;
  double least_mean_da = 0;  ///< over the days
  double least_changes = 0;
  StageParameters stages;
};

/// Detections against true changes.
struct ChangeScore {
  uint64_t told = 0, told_right = 0;         ///< objects that the map told
  uint64_t required = 0, required_told = 0;  ///< true changes that had to be told

  void Add(const ChangeScore& other) {
    told += other.told;
    told_right += other.told_right;
    required += other.required;
    required_told += other.required_told;
  }
  double Precision() const {
    return told == 0 ? 100 : 100.0 * static_cast<double>(told_right) / static_cast<double>(told);
  }
  double Recall() const {
    return required == 0 ? 100 : 100.0 * static_cast<double>(required_told) / static_cast<double>(required);
  }
};

/// Whether a told object is where a true one is: the middle of one lies in the other, with room for the size of a
/// voxel.
bool IsSamePlace(const Eigen::AlignedBox3d& told, const Eigen::AlignedBox3d& truth) {
  const double room = 0.4;  // metres
  const auto grown = [room](const Eigen::AlignedBox3d& box) {
    return Eigen::AlignedBox3d(box.min().array() - room, box.max().array() + room);
  };
  return grown(truth).contains(told.center()) || grown(told).contains(truth.center());
}

bool IsSameChange(const ChangedObject& told, const TrueChange& truth) {
  return (told.change == ChangeClass::kAppeared) == truth.appeared && IsSamePlace(told.box, truth.box);
}

/// One way of forgetting, with a map of its own.
struct Variant {
  const char* name;
  MergeParameters merge;
};

std::vector<Variant> Variants(const Options& options) {
  std::vector<Variant> variants = {{"eq. 8", options.stages.merge}};
  if (options.only_decay) return variants;
  variants.push_back({"no decay", {.alpha_min = 1, .alpha_max = 1, .contradicting_scans = 0}});
  variants.push_back({"last session", {.alpha_min = 0, .alpha_max = 0}});
  return variants;
}

/// A day's session, held in memory.
struct Day {
  SimulatedSession session;
  std::vector<LabelledScan> scans;
  std::vector<Pose> poses;  ///< odometry at first, then aligned

  ScanSource Source() const {
    return {scans.size(), [this](size_t i) -> absl::StatusOr<Scan> { return scans[i].scan; }};
  }
};

class Suite {
 public:
  Suite(const Options& options, const Street& street)
      : options_(options),
        street_(street),
        directory_(std::filesystem::temp_directory_path() / absl::StrFormat("mapkeep-lifelong-%d", getpid())) {}
  ~Suite() {
    maps_.reset();
    engine_.reset();
    std::filesystem::remove_all(directory_);
  }
  Suite(const Suite&) = delete;
  Suite& operator=(const Suite&) = delete;

  absl::StatusOr<bool> Run() {
    auto engine = OpenRocksDbEngine(directory_.string());
    if (!engine.ok()) return engine.status();
    engine_ = *std::move(engine);
    maps_ = OpenMapStore(*engine_, {});
    for (const Variant& variant : Variants(options_)) {
      if (auto made = maps_->Create({.name = NameOf(variant)}); !made.ok()) return made.status();
    }
    std::printf("%-13s %3s  %7s %7s  %8s %9s  %s\n", "", "day", "SA", "DA", "new", "just left",
                "DA of what left the day before, by days parked");
    for (int day = 0; day < options_.sessions; ++day) {
      if (absl::Status status = RunDay(day); !status.ok()) return status;
    }
    return Conclude();
  }

 private:
  static std::string NameOf(const Variant& variant) {
    std::string name = variant.name;
    for (char& c : name) c = c == ' ' ? '-' : c;
    return name;
  }

  absl::StatusOr<Day> Simulate(int day) const {
    DriveParameters drive = options_.drive;
    drive.start = RandomStream(SeedOf(options_.street.seed, static_cast<uint64_t>(day))).Uniform(0, 3);
    absl::StatusOr<SimulatedSession> session = DriveThrough(street_, day, drive);
    if (!session.ok()) return session.status();
    const std::string description = absl::StrFormat(
        "lifelong %s seed %d day %d scans %d speed %g change %g extension %d fence %d streets %d", options_.sensor,
        options_.street.seed, day, drive.scans, drive.speed, options_.street.change_rate,
        options_.street.extension_from.value_or(-1), options_.street.fence_until.value_or(-1), options_.street.streets);
    const std::filesystem::path file =
        options_.cache.empty() ? std::filesystem::path()
                               : std::filesystem::path(options_.cache) / absl::StrFormat("lifelong-%d.scans", day);
    auto scans = CachedScans(file, description, session->scans.count, session->labelled);
    if (!scans.ok()) return scans.status();
    Day simulated{*std::move(session), *std::move(scans), {}};
    for (size_t i = 0; i < simulated.scans.size(); ++i) simulated.scans[i].scan.time = simulated.session.times[i];
    // Truth that begins where the first session began: the map's frame is that of its first session.
    simulated.poses = options_.align && day > 0 ? simulated.session.odometry : simulated.session.truth;
    return simulated;
  }

  absl::Status RunDay(int day) {
    absl::StatusOr<Day> simulated = Simulate(day);
    if (!simulated.ok()) return simulated.status();
    const std::vector<TrueChange> changes = truth_.AddDay(simulated->session, simulated->scans);
    bool aligned = false;
    for (const Variant& variant : Variants(options_)) {
      if (absl::Status status = Merge(*simulated, day, variant, &aligned); !status.ok()) return status;
      if (absl::Status status = Judge(*simulated, day, variant, changes); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

  /// All variants see the poses that the first one found: what is compared is how they forget.
  absl::Status Merge(Day& day, int number, const Variant& variant, bool* aligned) {
    const auto base = maps_->Open(NameOf(variant));
    if (!base.ok()) return base.status();
    const ScanSource scans = day.Source();
    if (!*aligned) {
      if (options_.align && number > 0) {
        auto alignment = AlignToMap(**base, plans_, scans, day.poses, std::nullopt, {}, options_.stages.align, {});
        if (!alignment.ok()) return alignment.status();
        if (!alignment->accepted)
          return absl::InternalError(absl::StrFormat("day %d was refused: %s", number + 1, alignment->reason));
        day.poses = alignment->poses;
      }
      if (options_.stages.clean.refine_poses) {
        auto refined = RefinePoses(scans, day.poses, options_.stages.clean.refinement);
        if (!refined.ok()) return refined.status();
        day.poses = *std::move(refined);
      }
      *aligned = true;
    }
    const auto outline = ReadOutline(scans.count, [&](size_t i) -> absl::StatusOr<StagedScan> {
      return StagedScan{.scan = day.scans[i].scan, .pose = day.poses[i]};
    });
    if (!outline.ok()) return outline.status();
    const auto removal = CleanAgainstMap(**base, scans, *outline, day.poses, options_.stages.clean, {});
    if (!removal.ok()) return removal.status();
    kept_ = {};
    if (options_.breakdown) {
      for (size_t i = 0; i < scans.count; ++i) {
        const std::vector<PointLabel> labels = removal->Label(i, day.scans[i].scan);
        for (size_t k = 0; k < labels.size(); ++k) {
          if (labels[k] != PointLabel::kDynamic) {
            kept_.Add(day.poses[i] * day.scans[i].scan.points[k].cast<double>());
          }
        }
      }
    }
    const auto session = SummariseSession(scans, day.poses, *removal, kFirstMinute + kMinutesADay * number,
                                          options_.stages.session_map, {});
    if (!session.ok()) return session.status();
    const auto reach = ReachOf(*outline, day.poses, session->voxel_size, 0);
    return maps_
        ->Commit(NameOf(variant),
                 {.session = absl::StrFormat("day-%d", number + 1),
                  .base_epoch = (*base)->epoch(),
                  .blocks = [&](const Snapshot& head) -> absl::StatusOr<std::vector<Block>> {
                    auto merged =
                        MergeIntoMap(head, {**base, *session, scans, day.poses, reach, options_.stages.clean.exposure},
                                     variant.merge, options_.stages.filter, {});
                    if (!merged.ok()) return merged.status();
                    return std::move(merged->changed);
                  }})
        .status();
  }

  absl::StatusOr<PointCells> CellsOf(const Snapshot& map, bool only_static) const {
    PointCells cells;
    const auto tiles = map.Tiles({});
    if (!tiles.ok()) return tiles.status();
    for (const TileKey tile : *tiles) {
      const auto keys = map.BlocksOf(tile);
      if (!keys.ok()) return keys.status();
      for (const BlockKey key : *keys) {
        const auto block = map.Read(key);
        if (!block.ok()) return block.status();
        for (const Voxel& voxel : (*block)->voxels) {
          if (only_static && !voxel.is_static) continue;
          for (const Eigen::Vector3d& point : SubVoxelPoints(**block, voxel, map.map().voxel_size)) cells.Add(point);
        }
      }
    }
    return cells;
  }

  absl::Status Judge(const Day& simulated, int day, const Variant& variant, const std::vector<TrueChange>& changes) {
    const auto map = maps_->Open(NameOf(variant));
    if (!map.ok()) return map.status();
    absl::StatusOr<PointCells> cells = CellsOf(**map, true);
    if (!cells.ok()) return cells.status();
    const DayScore score = truth_.Score(*cells);
    std::string by_days;
    for (const auto& [days, part] : score.by_days) absl::StrAppendFormat(&by_days, " %d: %.1f", days, part.Percent());
    std::printf("%-13s %3d  %7.2f %7.2f  %8.1f %9.1f %s\n", variant.name, day + 1, score.statics.Percent(),
                score.dynamics.Percent(), score.just_arrived.Percent(), score.just_left.Percent(), by_days.c_str());
    if (options_.breakdown) {
      absl::StatusOr<PointCells> all = CellsOf(**map, false);
      if (!all.ok()) return all.status();
      const DayCells day_cells{std::move(kept_), *std::move(all), *std::move(cells)};
      LifelongBreakdown breakdown(simulated.session, day_cells);
      truth_.Score(day_cells.map_static, [&](const JudgedPoint& point) { breakdown.Add(point); });
      breakdown.Print();
    }
    std::fflush(stdout);
    std::vector<DayScore>& of_variant = scores_[variant.name];
    of_variant.push_back(score);
    if (day == 0) return absl::OkStatus();
    return JudgeChanges(day, variant, changes, **map);
  }

  /// Against the true changes of today, and those of yesterday: a map may follow a change one session late.
  absl::Status JudgeChanges(int day, const Variant& variant, const std::vector<TrueChange>& changes,
                            const Snapshot& map) {
    const auto before = maps_->Open(NameOf(variant), static_cast<uint64_t>(day));
    if (!before.ok()) return before.status();
    std::vector<BlockChange> blocks;
    const absl::Status compared = CompareSnapshots(**before, map, [&](const BlockChange& change) {
      blocks.push_back(change);
      return absl::OkStatus();
    });
    if (!compared.ok()) return compared;
    const auto told = ChangedObjectsBetween(**before, map, blocks);
    if (!told.ok()) return told.status();
    ChangeScore score;
    const std::vector<TrueChange>& yesterday = yesterdays_[variant.name];
    for (const ChangedObject& object : *told) {
      const auto is_it = [&](const TrueChange& truth) { return IsSameChange(object, truth); };
      const bool right = std::ranges::any_of(changes, is_it) || std::ranges::any_of(yesterday, is_it);
      ++score.told;
      score.told_right += right ? 1 : 0;
      if (options_.list) Describe(right ? "rightly told" : "wrongly told", variant, day, object);
    }
    // What is not told today may be told tomorrow.
    std::vector<TrueChange>& pending = pending_[variant.name];
    const auto is_told = [&](const TrueChange& truth) {
      return std::ranges::any_of(*told, [&](const ChangedObject& object) { return IsSameChange(object, truth); });
    };
    for (const TrueChange& truth : pending) {
      const bool late = is_told(truth);
      score.required_told += late ? 1 : 0;
      if (options_.list) DescribeMissed(late ? "told late" : "missed", variant, day, truth);
    }
    pending.clear();
    for (const TrueChange& truth : changes) {
      if (!truth.required) continue;
      ++score.required;
      if (is_told(truth)) {
        ++score.required_told;
        continue;
      }
      pending.push_back(truth);
      if (options_.list) DescribeMissed("not told today", variant, day, truth);
    }
    if (options_.list) {
      if (absl::Status status = DescribeLeftOut(variant, day, changes, **before, map, blocks); !status.ok()) {
        return status;
      }
    }
    changes_[variant.name].Add(score);
    yesterdays_[variant.name] = changes;
    return absl::OkStatus();
  }

  /// What hangs together and was not told, for how it looks: right if it is a true change of today or yesterday.
  absl::Status DescribeLeftOut(const Variant& variant, int day, const std::vector<TrueChange>& changes,
                               const Snapshot& before, const Snapshot& map,
                               const std::vector<BlockChange>& blocks) const {
    const auto all = ChangedObjectsBetween(before, map, blocks,
                                           {.most_contact = 1, .least_length = 0, .least_hits = 0, .least_in_view = 0});
    if (!all.ok()) return all.status();
    const auto yesterday = yesterdays_.find(variant.name);
    for (const ChangedObject& object : *all) {
      const auto is_it = [&](const TrueChange& truth) { return IsSameChange(object, truth); };
      const bool right = std::ranges::any_of(changes, is_it) ||
                         (yesterday != yesterdays_.end() && std::ranges::any_of(yesterday->second, is_it));
      Describe(right ? "candidate, right" : "candidate, wrong", variant, day, object);
    }
    return absl::OkStatus();
  }

  static void DescribeMissed(const char* what, const Variant& variant, int day, const TrueChange& truth) {
    std::printf("    %s: %s, day %d: %s %d %s at %.1f %.1f %.1f\n", what, variant.name, day + 1, truth.kind.c_str(),
                truth.id, truth.appeared ? "appeared" : "went", truth.box.center().x(), truth.box.center().y(),
                truth.box.center().z());
  }

  void Describe(const char* what, const Variant& variant, int day, const ChangedObject& object) const {
    const Eigen::Vector3d at = object.box.center(), size = object.box.sizes();
    constexpr std::array<const char*, 3> kNames = {"appeared", "disappeared", "unstable"};
    const auto [today, yesterday] = truth_.MovingPointsIn(object.box);
    std::printf(
        "    %s: %s, day %d: %s, %d voxels at %.1f %.1f %.1f, %.1f x %.1f x %.1f m, hits %.1f, contact %.2f, in view "
        "%.2f; "
        "moving points there %d, yesterday %d\n",
        what, variant.name, day + 1, kNames[static_cast<size_t>(object.change)], static_cast<int>(object.voxels),
        at.x(), at.y(), at.z(), size.x(), size.y(), size.z(), object.hits, object.contact, object.in_view,
        static_cast<int>(today), static_cast<int>(yesterday));
  }

  /// Whether the decay rule reached what was asked for, on every day.
  bool Conclude() const {
    std::printf("\n%-13s %8s %8s %8s %8s %10s %8s\n", "", "mean SA", "worst SA", "mean DA", "worst DA", "precision",
                "recall");
    bool reached = true;
    for (const Variant& variant : Variants(options_)) {
      double sum_sa = 0, sum_da = 0, worst_sa = 100, worst_da = 100;
      const std::vector<DayScore>& scores = scores_.at(variant.name);
      for (const DayScore& score : scores) {
        sum_sa += score.statics.Percent();
        sum_da += score.dynamics.Percent();
        worst_sa = std::min(worst_sa, score.statics.Percent());
        worst_da = std::min(worst_da, score.dynamics.Percent());
      }
      const auto days = static_cast<double>(scores.size());
      const auto found = changes_.find(variant.name);
      const ChangeScore changes = found == changes_.end() ? ChangeScore{} : found->second;
      std::printf("%-13s %8.2f %8.2f %8.2f %8.2f %10.1f %8.1f   (%d of %d told, %d of %d found)\n", variant.name,
                  sum_sa / days, worst_sa, sum_da / days, worst_da, changes.Precision(), changes.Recall(),
                  static_cast<int>(changes.told_right), static_cast<int>(changes.told),
                  static_cast<int>(changes.required_told), static_cast<int>(changes.required));
      if (variant.name != std::string("eq. 8")) continue;
      reached = worst_sa >= options_.least_sa && worst_da >= options_.least_da &&
                sum_da / days >= options_.least_mean_da &&
                std::min(changes.Precision(), changes.Recall()) >= options_.least_changes;
    }
    return reached;
  }

  const Options& options_;
  PlanCache plans_;
  const Street& street_;
  const std::filesystem::path directory_;
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<MapStore> maps_;
  LifelongTruth truth_;
  PointCells kept_;  // of the last session, if a breakdown is asked for
  std::map<std::string, std::vector<DayScore>> scores_;
  std::map<std::string, ChangeScore> changes_;
  std::map<std::string, std::vector<TrueChange>> yesterdays_;
  std::map<std::string, std::vector<TrueChange>> pending_;  // required, and not told yet
};

int Main(int count, char** arguments) {
  Options options;
  CLI::App app("Scores a map that is kept over days of a changing street");
  app.add_option("--sessions", options.sessions, "Days")->capture_default_str();
  app.add_option("--scans", options.drive.scans, "Scans a day")->capture_default_str();
  app.add_option("--speed", options.drive.speed, "Metres a second")->capture_default_str();
  app.add_option("--seed", options.street.seed, "Another street")->capture_default_str();
  app.add_option("--streets", options.street.streets, "Blocks of 100 m")->capture_default_str();
  app.add_option("--sensor", options.sensor, "hdl64, os1-64, vlp16 or livox")->capture_default_str();
  app.add_option("--change", options.street.change_rate, "Share of the parked cars that change from day to day")
      ->capture_default_str();
  app.add_option("--gamma", options.stages.merge.gamma, "Of eq. 8")->capture_default_str();
  app.add_option("--contradicting", options.stages.merge.contradicting_scans, "Scans; 0: eq. 8 alone")
      ->capture_default_str();
  app.add_option("--contradicted-share", options.stages.merge.contradicted_share,
                 "Of the voxels around one that says nothing, for it to be forgotten with them; above 1: never")
      ->capture_default_str();
  app.add_option("--probation", options.stages.filter.probation_height,
                 "Metres above known ground in which what is new waits for a second session; 0: nowhere")
      ->capture_default_str();
  app.add_option("--probation-width", options.stages.filter.probation_width, "As filter.probation_width, metres")
      ->capture_default_str();
  app.add_option("--probation-hits", options.stages.filter.probation_hits, "As filter.probation_hits, scans; 0: off")
      ->capture_default_str();
  app.add_option("--enclosure", options.stages.filter.enclosure_reach, "As filter.enclosure_reach, metres; 0: off")
      ->capture_default_str();
  app.add_option("--cohort", options.stages.merge.cohort_looked_through, "As merge.cohort_looked_through; above 1: off")
      ->capture_default_str();
  app.add_option("--remnant-share", options.stages.merge.remnant_share, "As merge.remnant_share; 1: off")
      ->capture_default_str();
  app.add_option("--cohort-met", options.stages.merge.cohort_met, "As merge.cohort_met")->capture_default_str();
  app.add_option("--cache", options.cache, "Directory that keeps the scans");
  app.add_flag("!--true-poses", options.align, "Do not align: take the true poses");
  app.add_flag("--only-decay", options.only_decay, "Eq. 8 alone");
  app.add_flag("--list", options.list, "Say what was told wrongly and what was missed");
  app.add_flag("--breakdown", options.breakdown, "Say which step lost what, by kind of object, distance and object");
  app.add_option("--least-sa", options.least_sa, "Exit 1 unless SA is this high after every day, percent");
  app.add_option("--least-da", options.least_da, "Exit 1 unless DA is, percent");
  app.add_option("--least-mean-da", options.least_mean_da, "Exit 1 unless the mean of DA is, percent");
  app.add_option("--least-changes", options.least_changes,
                 "Exit 1 unless precision and recall of changes are this high, percent");
  AddDorOptions(app, options.stages.clean);
  CLI11_PARSE(app, count, arguments);
  const absl::StatusOr<SensorModel> sensor = SensorNamed(options.sensor);
  if (!sensor.ok()) {
    std::fprintf(stderr, "%s\n", sensor.status().ToString().c_str());
    return 2;
  }
  options.drive.sensor = *sensor;
  const absl::StatusOr<Street> street = MakeStreet(options.street);
  if (!street.ok()) {
    std::fprintf(stderr, "%s\n", street.status().ToString().c_str());
    return 2;
  }
  const absl::StatusOr<bool> reached = Suite(options, *street).Run();
  if (!reached.ok()) {
    std::fprintf(stderr, "%s\n", reached.status().ToString().c_str());
    return 1;
  }
  return *reached ? 0 : 1;
}

}  // namespace
}  // namespace mapkeep

int main(int count, char** arguments) { return mapkeep::Main(count, arguments); }
