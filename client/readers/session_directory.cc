#include "client/readers/session_directory.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <absl/strings/string_view.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "client/readers/elite.h"
#include "client/readers/kitti.h"
#include "client/readers/kth.h"
#include "client/readers/mulran.h"
#include "client/readers/recorded_session.h"
#include "client/readers/recording.h"
#include "client/readers/scan_files.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

using Options = SessionOptions;

struct LayoutReader {
  SessionLayout layout;
  std::string_view name;
  std::string_view needs;  ///< for people
  bool (*is)(const fs::path& path);
  absl::StatusOr<SessionDirectory> (*open)(const fs::path& path, const Options& options);
  bool has_point_times = false;
};

bool HasFolder(const fs::path& path, const char* folder) {
  std::error_code error;
  return fs::is_directory(path / folder, error);
}

/// Whether a directory holds files of this suffix.
bool HasFiles(const fs::path& path, std::string_view suffix) { return ListScanFiles(path, suffix).ok(); }

constexpr std::array<LayoutReader, 6> kLayouts = {{
    {SessionLayout::kKitti, "kitti", "velodyne/", [](const fs::path& path) { return HasFolder(path, "velodyne"); },
     [](const fs::path& path, const Options&) { return OpenKitti(path); }},
    {SessionLayout::kElite, "elite", "Scans/", [](const fs::path& path) { return HasFolder(path, "Scans"); },
     [](const fs::path& path, const Options&) { return OpenElite(path); }},
    {SessionLayout::kKth, "kth", "pcd/", [](const fs::path& path) { return HasFolder(path, "pcd"); },
     [](const fs::path& path, const Options&) { return OpenKth(path); }},
    {SessionLayout::kMulran, "mulran", "Ouster/ and global_pose.csv", IsMulran, OpenMulran, true},
    {SessionLayout::kRosBag, "rosbag", "*.bag",
     [](const fs::path& path) { return IsRosBag(path) || HasFiles(path, ".bag"); }, OpenRosBagSession, true},
    {SessionLayout::kMcap, "mcap", "*.mcap",
     [](const fs::path& path) { return IsMcap(path) || HasFiles(path, ".mcap"); }, OpenMcapSession, true},
}};

const LayoutReader& ReaderOf(SessionLayout layout) { return kLayouts[static_cast<size_t>(layout)]; }

/// Scans a second where nothing says when they were taken. Removal asks for their order alone.
constexpr double kUsualScanRate = 10;

std::string Folders() {
  return absl::StrJoin(kLayouts, ", ", [](std::string* out, const LayoutReader& reader) {
    absl::StrAppendFormat(out, "%s (%s)", reader.needs, reader.name);
  });
}

absl::StatusOr<SessionLayout> Detect(const fs::path& path) {
  std::vector<SessionLayout> found;
  for (const LayoutReader& reader : kLayouts) {
    if (reader.is(path)) found.push_back(reader.layout);
  }
  std::error_code error;
  if (found.empty() && !fs::is_directory(path, error)) {
    return absl::InvalidArgumentError(absl::StrCat(
        path.string(), ": neither a ROS 1 bag nor an MCAP file, nor a session directory with one of ", Folders()));
  }
  if (found.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        path.string(), ": not a session directory: expected one of ", Folders(), " in it",
        HasFiles(path, ".db3") ? "; SQLite bags of ROS 2 first go through `ros2 bag convert` to mcap" : ""));
  }
  if (found.size() > 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(path.string(), ": holds more than one of ", Folders(), ": say which with --format"));
  }
  return found.front();
}

absl::Status AtFile(const fs::path& file, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat(file.string(), ": ", what));
}

/// What makes the intensities of a session [0, 1], told by its first scan.
float IntensityScaleOf(const Scan& scan) {
  float largest = 0;
  for (const float intensity : scan.intensities) {
    if (std::isfinite(intensity)) largest = std::max(largest, intensity);
  }
  if (largest <= 1) return 1;
  return largest <= 255 ? 1.F / 255 : 1.F / 65535;
}

absl::StatusOr<CheckedScan> Check(const SessionDirectory& directory, const fs::path& file, Scan raw) {
  if (raw.points.empty()) return AtFile(file, "the scan is empty");
  CheckedScan checked;
  checked.scan.points.reserve(raw.points.size());
  checked.scan.intensities.reserve(raw.intensities.size());
  for (size_t i = 0; i < raw.points.size(); ++i) {
    const Eigen::Vector3f& point = raw.points[i];
    const float range = point.norm();
    if (range < kNoReturnRange || (directory.nan_is_no_return && point.array().isNaN().all())) {
      checked.no_returns.push_back(static_cast<uint32_t>(i));
      continue;
    }
    if (!point.allFinite()) return AtFile(file, absl::StrFormat("point %d is not finite", i));
    if (!(range <= kFarthestReturn)) {
      return AtFile(file,
                    absl::StrFormat("point %d lies %.3g m from the sensor, farther than any LiDAR sees (%g m): is "
                                    "the file damaged?",
                                    i, range, kFarthestReturn));
    }
    checked.scan.points.push_back(point);
    if (raw.intensities.empty()) continue;
    if (!std::isfinite(raw.intensities[i])) return AtFile(file, absl::StrFormat("point %d has no finite intensity", i));
    checked.scan.intensities.push_back(std::clamp(raw.intensities[i] * directory.intensity_scale, 0.F, 1.F));
  }
  if (checked.scan.points.empty()) return AtFile(file, "the scan holds no return, only points at the sensor");
  return checked;
}

}  // namespace

std::string_view NameOf(SessionLayout layout) { return ReaderOf(layout).name; }

absl::StatusOr<SessionLayout> LayoutNamed(std::string_view name) {
  for (const LayoutReader& reader : kLayouts) {
    if (reader.name == name) return reader.layout;
  }
  return absl::InvalidArgumentError(
      absl::StrFormat("no session layout is called '%s': expected one of %s", name, Folders()));
}

absl::StatusOr<SessionDirectory> OpenSessionDirectory(const fs::path& path, const SessionOptions& options) {
  std::error_code error;
  if (!fs::exists(path, error)) return absl::NotFoundError(absl::StrCat(path.string(), ": no such file or directory"));
  std::optional<SessionLayout> layout = options.layout;
  if (!layout.has_value()) {
    absl::StatusOr<SessionLayout> detected = Detect(path);
    if (!detected.ok()) return detected.status();
    layout = *detected;
  }
  const LayoutReader& reader = ReaderOf(*layout);
  if (options.deskew && !reader.has_point_times) {
    return AtFile(path, absl::StrFormat("layout %s has no times of points: --deskew is not for it", reader.name));
  }
  absl::StatusOr<SessionDirectory> directory = reader.open(path, options);
  if (!directory.ok()) return directory;
  directory->path = path;
  directory->layout = *layout;
  const size_t count = directory->files.size();
  if (directory->poses.size() != count) {
    return AtFile(path / "poses.txt",
                  absl::StrFormat("%d poses for %d scans in %s", directory->poses.size(), count, reader.needs));
  }
  if (!directory->times.empty() && directory->times.size() != count) {
    return AtFile(path / "times.txt",
                  absl::StrFormat("%d times for %d scans in %s", directory->times.size(), count, reader.needs));
  }
  if (!directory->times.empty() && !CountsFrom1970(directory->times.front())) directory->times.clear();
  absl::StatusOr<Scan> first = directory->read_file(directory->files.front());
  if (!first.ok()) return first.status();
  directory->intensity_scale = IntensityScaleOf(*first);
  return directory;
}

absl::StatusOr<CheckedScan> ReadScan(const SessionDirectory& directory, size_t index) {
  const fs::path& file = directory.files[index];
  absl::StatusOr<Scan> raw = directory.read_file(file);
  if (!raw.ok()) return raw.status();
  absl::StatusOr<CheckedScan> checked = Check(directory, file, *std::move(raw));
  if (!checked.ok()) return checked;
  checked->scan.time = directory.times.empty() ? static_cast<double>(index) / kUsualScanRate : directory.times[index];
  return checked;
}

ScanSource SourceOf(SessionDirectory directory) {
  auto held = std::make_shared<const SessionDirectory>(std::move(directory));
  return {held->files.size(), [held](size_t index) -> absl::StatusOr<Scan> {
            absl::StatusOr<CheckedScan> checked = ReadScan(*held, index);
            if (!checked.ok()) return checked.status();
            return std::move(checked->scan);
          }};
}

}  // namespace mapkeep
