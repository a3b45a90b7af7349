#include "tests/bench/paper_table_1.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <chrono>
#include <cstdio>
#include <utility>

#include "client/readers/session_directory.h"
#include "core/dor/remover.h"
#include "core/ratio_map/session_map.h"
#include "core/registration/aligner.h"
#include "core/registration/thinning.h"
#include "core/voxels/normal.h"

namespace mapkeep {
namespace {

constexpr double kSpacing = 0.05;  // metres: static points are thinned to this before they are compared
constexpr double kVoxel = 0.2;     // metres, of the map

struct PublishedRow {
  const char* sequence;
  const char* method;
  double rmse, chamfer, seconds;
};
constexpr PublishedRow kTable1[] = {{"LT-ParkingLot (01-02)", "ELite", 0.076, 0.086, 4572},
                                    {"LT-ParkingLot (01-02)", "ELite++", 0.084, 0.075, 516},
                                    {"KAIST (01-04)", "ELite", 0.106, 0.446, 12732},
                                    {"KAIST (01-04)", "ELite++", 0.103, 0.541, 1205}};

double SecondsSince(std::chrono::steady_clock::time_point began) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
}

// A session as a map of its own: what did not move.
struct StaticSession {
  RegistrationTarget target;
  std::vector<Eigen::Vector3d> points;
  double seconds = 0;  // without the points, which only the metric needs
};

absl::StatusOr<StaticSession> Cleaned(const ScanSource& scans, std::span<const Pose> poses) {
  const auto began = std::chrono::steady_clock::now();
  DorParameters parameters;
  parameters.voxel_size = kVoxel;
  const absl::StatusOr<Removal> removal = RemoveDynamicObjects(scans, poses, {}, parameters);
  if (!removal.ok()) return removal.status();
  const Labeller label = [&](size_t i, const Scan& scan) { return removal->Label(i, scan); };
  const absl::StatusOr<SessionMap> map = BuildSessionMap(scans, poses, label, removal->evidence(), 0, {});
  if (!map.ok()) return map.status();
  StaticSession session{.target = {.voxel_size = kVoxel}};
  for (const SessionVoxel& voxel : map->voxels) {
    if (voxel.hits == 0) continue;
    const Eigen::Vector3d inside(voxel.mean[0] + 0.5, voxel.mean[1] + 0.5, voxel.mean[2] + 0.5);
    session.target.points.push_back(CornerOf(VoxelIndexOf(voxel.key), kVoxel) + inside * (kVoxel / 256));
    session.target.normals.push_back(DecodeNormal(voxel.normal));
  }
  session.seconds = SecondsSince(began);
  std::vector<Eigen::Vector3d> kept;
  for (size_t i = 0; i < scans.count; ++i) {
    const absl::StatusOr<Scan> scan = scans.read(i);
    if (!scan.ok()) return scan.status();
    const std::vector<PointLabel> labels = removal->Label(i, *scan);
    std::vector<Eigen::Vector3d> points;
    for (size_t k = 0; k < labels.size(); ++k) {
      if (labels[k] != PointLabel::kDynamic) points.push_back(poses[i] * scan->points[k].cast<double>());
    }
    points = ThinPoints(points, kSpacing);
    kept.insert(kept.end(), points.begin(), points.end());
  }
  session.points = ThinPoints(kept, kSpacing);
  return session;
}

std::string LineOf(const std::string& sequence, const std::string& method, double rmse, double chamfer,
                   double seconds) {
  return absl::StrFormat("%-26s%-26s%10.3f%10.3f%12.1f\n", sequence, method, rmse, chamfer, seconds);
}

std::string NameOfFolder(std::filesystem::path folder) {
  if (!folder.has_filename()) folder = folder.parent_path();
  return folder.filename().string();
}

}  // namespace

absl::StatusOr<std::vector<AlignmentRow>> RowsOfSessions(const std::filesystem::path& first,
                                                         const std::filesystem::path& second) {
  const absl::StatusOr<SessionDirectory> of_map = OpenSessionDirectory(first);
  if (!of_map.ok()) return of_map.status();
  const absl::StatusOr<SessionDirectory> of_session = OpenSessionDirectory(second);
  if (!of_session.ok()) return of_session.status();
  absl::StatusOr<StaticSession> founder = Cleaned(SourceOf(*of_map), of_map->poses);
  if (!founder.ok()) return founder.status();
  std::vector<AlignmentRow> rows;
  for (const auto& [method, poses] :
       {std::pair("Mapkeep", ScanPoses::kPoseGraph), std::pair("Mapkeep, eq. 2", ScanPoses::kFusion)}) {
    AlignmentRow row{.method = method, .seconds = founder->seconds};
    AlignParameters parameters;
    parameters.scan_poses = poses;
    const ScanSource scans = SourceOf(*of_session);
    // What the map knows of itself is made anew for each row, so that both take the same time.
    const TargetMap map = MapOf(founder->target);
    const auto began = std::chrono::steady_clock::now();
    const absl::StatusOr<Alignment> alignment = AlignSession(scans, of_session->poses, map, {}, parameters);
    if (!alignment.ok()) return alignment.status();
    row.seconds += SecondsSince(began);
    row.aligned = alignment->accepted;
    row.reason = alignment->reason;
    if (row.aligned) {
      const absl::StatusOr<StaticSession> session = Cleaned(scans, alignment->poses);
      if (!session.ok()) return session.status();
      row.seconds += session->seconds;
      row.distance = DistanceBetween(founder->points, session->points);
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

std::string PrintedTable1(const std::string& name, std::span<const AlignmentRow> rows) {
  std::string text = "Table 1: a session on the map of another, points within 0.5 m\n";
  absl::StrAppendFormat(&text, "%-26s%-26s%10s%10s%12s\n", "sequence", "method", "RMSE m", "CD m", "seconds");
  for (const PublishedRow& row : kTable1) {
    text += LineOf(row.sequence, absl::StrCat(row.method, " (paper)"), row.rmse, row.chamfer, row.seconds);
  }
  for (const AlignmentRow& row : rows) {
    if (row.aligned) {
      text += LineOf(name, row.method, row.distance.rmse, row.distance.chamfer, row.seconds);
    } else {
      absl::StrAppendFormat(&text, "%-26s%-26srefused: %s\n", name, row.method, row.reason);
    }
  }
  return text;
}

int RunPaperTable1(std::span<const std::string> folders) {
  const absl::StatusOr<std::vector<AlignmentRow>> rows = RowsOfSessions(folders[0], folders[1]);
  if (!rows.ok()) {
    std::fprintf(stderr, "paper_tables: %s\n", std::string(rows.status().message()).c_str());
    return 1;
  }
  std::fputs(PrintedTable1(absl::StrCat(NameOfFolder(folders[0]), ", ", NameOfFolder(folders[1])), *rows).c_str(),
             stdout);
  return 0;
}

}  // namespace mapkeep
