#include "tests/bench/paper_table_2_3.h"

#include <absl/container/flat_hash_map.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <tbb/parallel_for.h>

#include <array>
#include <cmath>
#include <cstdio>

#include "client/readers/pcd_file.h"
#include "client/readers/session_directory.h"

namespace mapkeep {
namespace {

constexpr float kNear = 0.05F;  // metres: the benchmark's

using Cell = std::array<int32_t, 3>;

Cell CellOf(const Eigen::Vector3f& point) {
  const auto at = [](float x) { return static_cast<int32_t>(std::floor(x / kNear)); };
  return {at(point.x()), at(point.y()), at(point.z())};
}

/// The kept points in cells as wide as the distance that is asked for.
class KeptPoints {
 public:
  explicit KeptPoints(std::span<const Eigen::Vector3f> points) {
    next_.reserve(points.size());
    points_.assign(points.begin(), points.end());
    for (uint32_t i = 0; i < points.size(); ++i) {
      const auto [at, is_new] = first_.try_emplace(CellOf(points[i]), kNone);
      next_.push_back(at->second);
      at->second = i;
    }
  }

  bool AnyNear(const Eigen::Vector3f& point) const {
    const Cell centre = CellOf(point);
    for (int i = 0; i < 27; ++i) {
      const int k = (i + 13) % 27;  // its own cell first: most points are near themselves
      const auto cell = first_.find({centre[0] + k % 3 - 1, centre[1] + k / 3 % 3 - 1, centre[2] + k / 9 - 1});
      if (cell == first_.end()) continue;
      for (uint32_t at = cell->second; at != kNone; at = next_[at]) {
        if ((points_[at] - point).squaredNorm() <= kNear * kNear) return true;
      }
    }
    return false;
  }

 private:
  static constexpr uint32_t kNone = ~uint32_t{0};
  absl::flat_hash_map<Cell, uint32_t> first_;
  std::vector<uint32_t> next_;  // of the same cell
  std::vector<Eigen::Vector3f> points_;
};

struct PublishedRow {
  const char* method;
  std::array<std::array<double, 4>, 3> figures;  // SA, DA, AA, seconds on KITTI 00, KITTI 05, AV2
};

// Table 2 of the paper.
constexpr std::array<PublishedRow, 5> kTable2 = {{
    {"Removert", {{{99.44, 41.53, 64.26, 36.86}, {99.42, 22.28, 47.06, 182.94}, {98.74, 34.10, 58.02, 440.43}}}},
    {"ERASOR", {{{66.70, 98.54, 81.07, 5.57}, {69.40, 99.06, 82.92, 12.42}, {77.51, 99.18, 87.68, 508.66}}}},
    {"OctoMap", {{{68.05, 99.69, 82.37, 194.19}, {66.28, 99.24, 81.10, 535.60}, {69.04, 97.50, 82.04, 5421.68}}}},
    {"OctoMap w/ GF", {{{86.09, 98.84, 92.25, 212.38}, {86.55, 97.94, 91.88, 570.60}, {77.88, 86.18, 81.92, 5503.41}}}},
    {"ELite++", {{{97.86, 98.24, 98.05, 66.02}, {98.39, 94.47, 96.41, 114.83}, {94.76, 88.90, 91.78, 438.19}}}},
}};
constexpr std::array<const char*, 3> kSequences = {"KITTI00", "KITTI05", "AV2.0"};

// Table 3 of the paper (its AA column is that of KITTI 05).
constexpr std::array<std::pair<const char*, std::array<double, 3>>, 4> kTable3 = {{
    {"none", {97.60, 80.75, 88.78}},
    {"+ recovery", {98.70, 80.74, 89.27}},
    {"+ bottom", {98.67, 82.25, 90.09}},
    {"+ clusters", {98.39, 94.47, 96.41}},
}};

std::string LineOf(const std::string& where, const std::string& what, double sa, double da, double aa,
                   const std::string& time) {
  return absl::StrFormat("%-20s%-26s%8.2f%8.2f%8.2f%12s\n", where, what, sa, da, aa, time);
}

}  // namespace

RemovalScore ScoreByNearestKept(const Scan& truth, std::span<const Eigen::Vector3f> kept) {
  const KeptPoints points(kept);
  RemovalScore score;
  for (size_t i = 0; i < truth.points.size(); ++i) {
    const bool near = points.AnyNear(truth.points[i]);
    if (truth.intensities[i] > 0.5F) {
      ++score.moving;
      score.removed += near ? 0 : 1;
    } else {
      ++score.statics;
      score.kept += near ? 1 : 0;
    }
  }
  return score;
}

absl::StatusOr<KthTables> TablesOfKthFolder(const std::filesystem::path& folder) {
  const absl::StatusOr<SessionDirectory> directory = OpenSessionDirectory(folder, {.layout = SessionLayout::kKth});
  if (!directory.ok()) return directory.status();
  const absl::StatusOr<Scan> truth = ReadPcdPoints(folder / "gt_cloud.pcd");
  if (!truth.ok()) return truth.status();
  if (truth->intensities.size() != truth->points.size()) {
    return absl::InvalidArgumentError(absl::StrCat((folder / "gt_cloud.pcd").string(), ": has no intensity"));
  }
  const size_t count = directory->files.size();
  std::vector<Scan> scans(count);
  std::vector<absl::Status> results(count);
  tbb::parallel_for(size_t{0}, count, [&](size_t i) {
    absl::StatusOr<CheckedScan> scan = ReadScan(*directory, i);
    results[i] = scan.status();
    if (scan.ok()) scans[i] = std::move(scan->scan);
  });
  for (const absl::Status& result : results) {
    if (!result.ok()) return result;
  }
  const LabelScorer scorer = [&](std::span<const std::vector<PointLabel>> labels) {
    std::vector<Eigen::Vector3f> kept;
    for (size_t i = 0; i < count; ++i) {
      for (size_t k = 0; k < labels[i].size(); ++k) {
        if (labels[i][k] == PointLabel::kDynamic) continue;
        kept.emplace_back((directory->poses[i] * scans[i].points[k].cast<double>()).cast<float>());
      }
    }
    return ScoreByNearestKept(*truth, kept);
  };
  absl::StatusOr<std::vector<AblationRow>> rows = RunAblation(scans, directory->poses, AblationSteps(), scorer);
  if (!rows.ok()) return rows.status();
  std::filesystem::path named = folder;
  if (!named.has_filename()) named = named.parent_path();
  return KthTables{named.filename().string(), count, *std::move(rows)};
}

std::string PrintedTables(std::span<const KthTables> folders) {
  std::string text = "Table 2: removal, nearest kept point within 0.05 m\n";
  absl::StrAppendFormat(&text, "%-20s%-26s%8s%8s%8s%12s\n", "sequence", "method", "SA %", "DA %", "AA %", "seconds");
  for (const PublishedRow& row : kTable2) {
    for (size_t i = 0; i < kSequences.size(); ++i) {
      const auto& [sa, da, aa, seconds] = row.figures[i];
      text += LineOf(kSequences[i], absl::StrCat(row.method, " (paper)"), sa, da, aa, absl::StrFormat("%.2f", seconds));
    }
  }
  for (const KthTables& folder : folders) {
    const AblationRow& row = folder.ablation.back();
    text += LineOf(folder.name, "Mapkeep", row.score.sa(), row.score.da(), row.score.aa(),
                   absl::StrFormat("%.2f", row.ms_per_scan * static_cast<double>(folder.scans) / 1000));
  }
  text += "\nTable 3: ablation\n";
  absl::StrAppendFormat(&text, "%-20s%-26s%8s%8s%8s%12s\n", "sequence", "refinements", "SA %", "DA %", "AA %",
                        "ms/scan");
  for (const auto& [name, figures] : kTable3) {
    text += LineOf("KITTI05 (paper)", name, figures[0], figures[1], figures[2], "-");
  }
  for (const KthTables& folder : folders) {
    for (const AblationRow& row : folder.ablation) {
      text += LineOf(folder.name, row.name, row.score.sa(), row.score.da(), row.score.aa(),
                     absl::StrFormat("%.1f", row.ms_per_scan));
    }
  }
  return text;
}

int RunPaperTables2And3(std::span<const std::string> folders) {
  std::vector<KthTables> tables;
  for (const std::string& folder : folders) {
    absl::StatusOr<KthTables> of_folder = TablesOfKthFolder(folder);
    if (!of_folder.ok()) {
      std::fprintf(stderr, "paper_tables: %s\n", std::string(of_folder.status().message()).c_str());
      return 1;
    }
    tables.push_back(*std::move(of_folder));
  }
  std::fputs(PrintedTables(tables).c_str(), stdout);
  return 0;
}

}  // namespace mapkeep
