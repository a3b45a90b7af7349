#include "client/readers/elite.h"

#include <utility>

#include "client/readers/pcd_file.h"
#include "client/readers/scan_files.h"
#include "client/readers/text_files.h"

namespace mapkeep {

namespace fs = std::filesystem;

absl::StatusOr<SessionDirectory> OpenElite(const fs::path& directory) {
  SessionDirectory session;
  session.read_file = ReadPcdPoints;
  session.nan_is_no_return = true;
  absl::StatusOr<std::vector<fs::path>> files = ListScanFiles(directory / "Scans", ".pcd");
  if (!files.ok()) return files.status();
  session.files = *std::move(files);
  absl::StatusOr<std::vector<Pose>> poses = ReadPoses(directory / "poses.txt");
  if (!poses.ok()) return poses.status();
  session.poses = *std::move(poses);
  absl::StatusOr<std::vector<double>> times = ReadTimes(directory / "times.txt");
  if (!times.ok()) return times.status();
  session.times = *std::move(times);
  return session;
}

}  // namespace mapkeep
