#include "client/cli/ablation.h"

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>
#include <absl/time/clock.h>
#include <absl/time/time.h>
#include <tbb/parallel_for.h>

#include <fstream>
#include <system_error>
#include <utility>

#include "core/dor/pose_refinement.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr uint32_t kTrueStatic = 9, kTrueMoving = 251;

absl::StatusOr<std::vector<uint32_t>> ReadClasses(const fs::path& path, const CheckedScan& scan) {
  std::error_code error;
  const uintmax_t bytes = fs::file_size(path, error);
  if (error) return absl::NotFoundError(absl::StrCat(path.string(), ": no labels: ", error.message()));
  const size_t points = scan.scan.points.size() + scan.no_returns.size();
  if (bytes != points * sizeof(uint32_t)) {
    return absl::InvalidArgumentError(absl::StrCat(path.string(), ": ", bytes, " bytes for ", points, " points"));
  }
  std::vector<uint32_t> all(points), classes;
  std::ifstream file(path, std::ios::binary);
  if (!file.read(reinterpret_cast<char*>(all.data()), static_cast<std::streamsize>(bytes))) {
    return absl::InvalidArgumentError(absl::StrCat(path.string(), ": cannot be read"));
  }
  auto no_return = scan.no_returns.begin();
  for (size_t i = 0; i < all.size(); ++i) {
    if (no_return != scan.no_returns.end() && *no_return == i) {
      ++no_return;
    } else {
      classes.push_back(all[i] & 0xffff);
    }
  }
  return classes;
}

}  // namespace

std::vector<AblationStep> AblationSteps() {
  DorParameters p;
  p.exposure.sub_voxels = false;
  p.exposure.neighbour_hits = false;
  p.exposure.margin_by_range = 0;
  p.exposure.clear_around = 0;
  p.restore = p.verify_ankles = p.cluster = p.confirm = p.doubt = p.inherit = p.surround = false;
  p.departures = p.drive_offs = p.transients = false;
  p.refine_poses = false;
  std::vector<AblationStep> steps;
  const auto add = [&](const char* name) { steps.push_back({name, p}); };
  const DorParameters all;
  add("none");
  p.restore = all.restore;
  add("+ recovery");
  p.verify_ankles = all.verify_ankles;
  add("+ bottom");
  p.cluster = all.cluster;
  add("+ clusters");
  p.exposure.margin_by_range = all.exposure.margin_by_range;
  add("+ margin by range");
  p.exposure.neighbour_hits = all.exposure.neighbour_hits;
  add("+ neighbour hits");
  p.exposure.sub_voxels = all.exposure.sub_voxels;
  add("+ sub-voxels");
  p.exposure.clear_around = all.exposure.clear_around;
  p.confirm = all.confirm;
  add("+ confirmed voids");
  p.doubt = all.doubt;
  add("+ doubt");
  p.inherit = all.inherit;
  add("+ inherit");
  p.departures = all.departures;
  add("+ departures");
  p.transients = all.transients;
  add("+ transients");
  p.surround = all.surround;
  add("+ surround");
  p.drive_offs = all.drive_offs;
  add("+ drive-offs");
  p.refine_poses = all.refine_poses;
  add("+ pose refinement");
  return steps;
}

absl::StatusOr<std::vector<AblationRow>> RunAblation(std::span<const Scan> scans, std::span<const Pose> poses,
                                                     std::span<const AblationStep> steps, const LabelScorer& scorer,
                                                     const AblationProgress& progress) {
  const ScanSource source{scans.size(), [&](size_t index) -> absl::StatusOr<Scan> { return scans[index]; }};
  std::vector<AblationRow> rows;
  for (const AblationStep& step : steps) {
    const double done = static_cast<double>(rows.size()) / static_cast<double>(steps.size());
    if (progress && !progress(step.name, done)) return absl::CancelledError("stopped");
    const absl::Time begin = absl::Now();
    std::vector<Pose> refined(poses.begin(), poses.end());
    if (step.parameters.refine_poses) {
      absl::StatusOr<std::vector<Pose>> better = RefinePoses(source, poses, step.parameters.refinement);
      if (!better.ok()) return better.status();
      refined = *std::move(better);
    }
    const absl::StatusOr<Removal> removal = RemoveDynamicObjects(source, refined, {}, step.parameters);
    if (!removal.ok()) return removal.status();
    std::vector<std::vector<PointLabel>> labels(scans.size());
    tbb::parallel_for(size_t{0}, scans.size(), [&](size_t i) { labels[i] = removal->Label(i, scans[i]); });
    const double milliseconds = absl::ToDoubleMilliseconds(absl::Now() - begin);
    rows.push_back({step.name, scorer(labels), milliseconds / static_cast<double>(scans.size())});
  }
  return rows;
}

absl::StatusOr<LabelledSession> ReadLabelledSession(const SessionDirectory& directory) {
  const size_t count = directory.files.size();
  const fs::path folder = directory.path / (fs::exists(directory.path / "label") ? "label" : "labels");
  if (!fs::is_directory(folder)) {
    return absl::NotFoundError(
        absl::StrCat(directory.path.string(), ": has no label/, so there is no truth to score by"));
  }
  LabelledSession session{std::vector<Scan>(count), directory.poses, std::vector<std::vector<uint32_t>>(count)};
  std::vector<absl::Status> results(count);
  tbb::parallel_for(size_t{0}, count, [&](size_t i) {
    absl::StatusOr<CheckedScan> scan = ReadScan(directory, i);
    results[i] = scan.status();
    if (!scan.ok()) return;
    auto classes = ReadClasses(folder / (directory.files[i].stem().string() + ".label"), *scan);
    results[i] = classes.status();
    if (!classes.ok()) return;
    session.scans[i] = std::move(scan->scan);
    session.truth[i] = *std::move(classes);
  });
  for (const absl::Status& result : results) {
    if (!result.ok()) return result;
  }
  return session;
}

RemovalScore ScoreLabels(std::span<const std::vector<uint32_t>> truth,
                         std::span<const std::vector<PointLabel>> labels) {
  RemovalScore score;
  for (size_t i = 0; i < truth.size(); ++i) {
    for (size_t k = 0; k < truth[i].size(); ++k) {
      const bool removed = labels[i][k] == PointLabel::kDynamic;
      if (truth[i][k] == kTrueStatic) {
        ++score.statics;
        score.kept += removed ? 0 : 1;
      } else if (truth[i][k] == kTrueMoving) {
        ++score.moving;
        score.removed += removed ? 1 : 0;
      }
    }
  }
  return score;
}

}  // namespace mapkeep
