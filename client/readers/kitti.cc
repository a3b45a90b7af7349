#include "client/readers/kitti.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <array>
#include <cstring>
#include <fstream>
#include <optional>
#include <string>
#include <utility>

#include "client/readers/scan_files.h"
#include "client/readers/text_files.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

absl::StatusOr<Scan> ReadBin(const fs::path& file) {
  constexpr size_t kPointBytes = 4 * sizeof(float);
  std::error_code error;
  const uintmax_t bytes = fs::file_size(file, error);
  if (error) return absl::NotFoundError(absl::StrCat(file.string(), ": ", error.message()));
  if (bytes % kPointBytes != 0) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: truncated: %d bytes is no multiple of %d (float32 x y z intensity)", file.string(), bytes, kPointBytes));
  }
  const size_t count = bytes / kPointBytes;
  if (count > kMostPoints) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s: %d points, more than the %d a scan may hold", file.string(), count, kMostPoints));
  }
  std::vector<std::array<float, 4>> rows(count);
  std::ifstream stream(file, std::ios::binary);
  if (!stream.read(reinterpret_cast<char*>(rows.data()), static_cast<std::streamsize>(bytes))) {
    return absl::InvalidArgumentError(absl::StrCat(file.string(), ": cannot be read: ", std::strerror(errno)));
  }
  Scan scan;
  scan.points.reserve(count);
  scan.intensities.reserve(count);
  for (const auto& [x, y, z, intensity] : rows) {
    scan.points.emplace_back(x, y, z);
    scan.intensities.push_back(intensity);
  }
  return scan;
}

}  // namespace

absl::StatusOr<SessionDirectory> OpenKitti(const fs::path& directory) {
  SessionDirectory session;
  session.read_file = ReadBin;
  absl::StatusOr<std::vector<fs::path>> files = ListScanFiles(directory / "velodyne", ".bin");
  if (!files.ok()) return files.status();
  session.files = *std::move(files);

  absl::StatusOr<std::vector<Pose>> poses = ReadPoses(directory / "poses.txt");
  if (!poses.ok()) return poses.status();
  session.poses = *std::move(poses);
  absl::StatusOr<std::optional<Pose>> camera_from_lidar = ReadCalibration(directory / "calib.txt");
  if (!camera_from_lidar.ok()) return camera_from_lidar.status();
  if (camera_from_lidar->has_value()) {
    const Pose& tr = **camera_from_lidar;
    for (Pose& pose : session.poses) pose = tr.inverse() * pose * tr;
  }

  absl::StatusOr<std::vector<double>> times = ReadTimes(directory / "times.txt");
  if (!times.ok()) return times.status();
  session.times = *std::move(times);
  return session;
}

}  // namespace mapkeep
