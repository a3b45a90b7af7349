#include "client/readers/kth.h"

#include <utility>

#include "client/readers/pcd_file.h"
#include "client/readers/pcd_header.h"
#include "client/readers/scan_files.h"
#include "client/readers/text_files.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

absl::StatusOr<Scan> ReadInSensorFrame(const fs::path& file) {
  absl::StatusOr<PcdHeader> header = ReadPcdHeader(file);
  if (!header.ok()) return header.status();
  absl::StatusOr<Scan> scan = ReadPcdPoints(file);
  if (!scan.ok()) return scan;
  const Pose sensor_world = header->viewpoint.inverse();
  for (Eigen::Vector3f& point : scan->points) point = (sensor_world * point.cast<double>()).cast<float>();
  return scan;
}

}  // namespace

absl::StatusOr<SessionDirectory> OpenKth(const fs::path& directory) {
  SessionDirectory session;
  session.read_file = ReadInSensorFrame;
  session.nan_is_no_return = true;
  absl::StatusOr<std::vector<fs::path>> files = ListScanFiles(directory / "pcd", ".pcd");
  if (!files.ok()) return files.status();
  session.files = *std::move(files);
  session.poses.reserve(session.files.size());
  for (const fs::path& file : session.files) {
    absl::StatusOr<PcdHeader> header = ReadPcdHeader(file);
    if (!header.ok()) return header.status();
    session.poses.push_back(header->viewpoint);
  }
  absl::StatusOr<std::vector<double>> times = ReadTimes(directory / "times.txt");
  if (!times.ok()) return times.status();
  session.times = *std::move(times);
  return session;
}

}  // namespace mapkeep
