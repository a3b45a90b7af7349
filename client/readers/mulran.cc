#include "client/readers/mulran.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "client/readers/deskew.h"
#include "client/readers/pose_track.h"
#include "client/readers/scan_files.h"
#include "client/readers/text_files.h"

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

enum class TimeType : uint8_t { kNone, kUint32Nanoseconds, kInt32Nanoseconds, kFloatSeconds };
enum class IntensityType : uint8_t { kFloat, kUint8 };

/// How one point lies in a file; x, y and z come first, as float32.
struct PointLayout {
  std::string_view sensor;  ///< the folder; empty: any
  size_t bytes = 16;
  size_t intensity_at = 12;
  IntensityType intensity = IntensityType::kFloat;
  TimeType time = TimeType::kNone;
  size_t time_at = 0;
};

constexpr std::array<PointLayout, 6> kLayouts = {{
    {"", 16, 12, IntensityType::kFloat, TimeType::kNone, 0},
    {"Ouster", 26, 12, IntensityType::kFloat, TimeType::kUint32Nanoseconds, 16},
    {"Velodyne", 22, 12, IntensityType::kFloat, TimeType::kFloatSeconds, 18},
    {"Avia", 19, 12, IntensityType::kUint8, TimeType::kUint32Nanoseconds, 15},
    {"Aeva", 25, 12, IntensityType::kFloat, TimeType::kInt32Nanoseconds, 20},
    {"Aeva", 29, 25, IntensityType::kFloat, TimeType::kInt32Nanoseconds, 20},
}};
constexpr std::array<std::string_view, 4> kSensors = {"Ouster", "Velodyne", "Avia", "Aeva"};
constexpr double kLongestSweep = 1;  ///< seconds

struct Place {
  fs::path scans, poses;
  std::string_view sensor;
};

std::optional<Place> Find(const fs::path& directory) {
  std::error_code error;
  for (const std::string_view sensor : kSensors) {
    for (const fs::path& scans : {directory / sensor, directory / "LiDAR" / sensor}) {
      if (!fs::is_directory(scans, error)) continue;
      const std::string truth = absl::StrCat(std::string(sensor), "_gt.txt");
      for (const fs::path& poses : {directory / "global_pose.csv", directory / "LiDAR_GT" / truth,
                                    directory / "LiDAR_GT" / "global_pose.csv", directory / truth}) {
        if (fs::exists(poses, error)) return Place{scans, poses, sensor};
      }
    }
  }
  return std::nullopt;
}

template <typename Number>
Number At(const char* bytes) {
  Number number;
  std::memcpy(&number, bytes, sizeof(number));
  return number;
}

double OffsetOf(const char* point, const PointLayout& layout) {
  switch (layout.time) {
    case TimeType::kUint32Nanoseconds:
      return 1e-9 * At<uint32_t>(point + layout.time_at);
    case TimeType::kInt32Nanoseconds:
      return 1e-9 * At<int32_t>(point + layout.time_at);
    case TimeType::kFloatSeconds:
      return At<float>(point + layout.time_at);
    case TimeType::kNone:
      break;
  }
  return 0;
}

/// Whether the bytes can be points of this layout: coordinates that a LiDAR gives, times within a sweep.
bool CanBe(const std::string& bytes, const PointLayout& layout, std::string_view sensor) {
  if (bytes.size() % layout.bytes != 0 || (!layout.sensor.empty() && layout.sensor != sensor)) return false;
  for (size_t at = 0; at < bytes.size(); at += layout.bytes) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const float c = At<float>(bytes.data() + at + 4 * axis);
      if (!(std::abs(c) < kFarthestReturn)) return false;
      // Bytes of another field make tiny numbers.
      if (c != 0 && std::abs(c) < 1e-20F) return false;
    }
    if (!(std::abs(OffsetOf(bytes.data() + at, layout)) <= kLongestSweep)) return false;
  }
  return true;
}

absl::StatusOr<std::string> ReadWhole(const fs::path& file) {
  std::error_code error;
  const uint64_t size = fs::file_size(file, error);
  if (error) return absl::NotFoundError(absl::StrCat(file.string(), ": ", error.message()));
  if (size > kMostPoints * 32)
    return absl::InvalidArgumentError(absl::StrCat(file.string(), ": is too large for a scan"));
  std::string bytes(size, '\0');
  std::ifstream stream(file, std::ios::binary);
  if (!stream.read(bytes.data(), static_cast<std::streamsize>(size))) {
    return absl::InvalidArgumentError(absl::StrCat(file.string(), ": cannot be read"));
  }
  return bytes;
}

absl::StatusOr<PointLayout> LayoutOf(const fs::path& file, std::string_view sensor) {
  const absl::StatusOr<std::string> bytes = ReadWhole(file);
  if (!bytes.ok()) return bytes.status();
  for (const PointLayout& layout : kLayouts) {
    if (!bytes->empty() && CanBe(*bytes, layout, sensor)) return layout;
  }
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s: its %d bytes are no points: expected float32 x y z intensity (16 bytes), or HeLiPR's points of %s",
      file.string(), bytes->size(), sensor));
}

absl::StatusOr<double> TimeOf(const fs::path& file) {
  uint64_t nanoseconds = 0;
  if (!absl::SimpleAtoi(file.stem().string(), &nanoseconds)) {
    return absl::InvalidArgumentError(absl::StrCat(file.string(), ": expected a name that is its time in nanoseconds"));
  }
  return 1e-9 * static_cast<double>(nanoseconds);
}

absl::StatusOr<PoseTrack> ReadTrack(const Place& place, const fs::path& directory) {
  const absl::StatusOr<std::vector<TimedPose>> rows = ReadTimedPoses(place.poses);
  if (!rows.ok()) return rows.status();
  PoseTrack track;
  for (const TimedPose& row : *rows) track.Add(1e-9 * row.time, row.pose);
  track.Sort();
  const absl::StatusOr<std::optional<Pose>> vehicle_from_lidar = ReadCalibration(directory / "calib.txt");
  if (!vehicle_from_lidar.ok()) return vehicle_from_lidar.status();
  return vehicle_from_lidar->has_value() ? track.Followed(**vehicle_from_lidar) : track;
}

absl::StatusOr<Scan> ReadPoints(const fs::path& file, const PointLayout& layout, const PoseTrack* deskew) {
  const absl::StatusOr<std::string> bytes = ReadWhole(file);
  if (!bytes.ok()) return bytes.status();
  if (bytes->size() % layout.bytes != 0) {
    return absl::InvalidArgumentError(absl::StrFormat("%s: %d bytes are no whole number of points of %d bytes",
                                                      file.string(), bytes->size(), layout.bytes));
  }
  Scan scan;
  std::vector<float> offsets;
  for (const char* point = bytes->data(); point != bytes->data() + bytes->size(); point += layout.bytes) {
    scan.points.emplace_back(At<float>(point), At<float>(point + 4), At<float>(point + 8));
    const char* intensity = point + layout.intensity_at;
    scan.intensities.push_back(layout.intensity == IntensityType::kFloat ? At<float>(intensity)
                                                                         : static_cast<float>(At<uint8_t>(intensity)));
    if (deskew != nullptr) offsets.push_back(static_cast<float>(OffsetOf(point, layout)));
  }
  if (deskew == nullptr) return scan;
  const absl::StatusOr<double> time = TimeOf(file);
  if (!time.ok()) return time.status();
  const absl::Status status = Deskew(*deskew, *time, offsets, &scan);
  if (!status.ok()) return absl::InvalidArgumentError(absl::StrFormat("%s: %s", file.string(), status.message()));
  return scan;
}

}  // namespace

bool IsMulran(const fs::path& directory) { return Find(directory).has_value(); }

absl::StatusOr<SessionDirectory> OpenMulran(const fs::path& directory, const SessionOptions& options) {
  const std::optional<Place> place = Find(directory);
  if (!place.has_value()) {
    return absl::InvalidArgumentError(
        absl::StrCat(directory.string(),
                     ": expected Ouster/ (or Velodyne, Avia, Aeva; also in LiDAR/) with *.bin, and "
                     "global_pose.csv or LiDAR_GT/Ouster_gt.txt"));
  }
  const absl::StatusOr<std::vector<fs::path>> files = ListScanFiles(place->scans, ".bin");
  if (!files.ok()) return files.status();
  absl::StatusOr<PoseTrack> read = ReadTrack(*place, directory);
  if (!read.ok()) return read.status();
  const auto track = std::make_shared<const PoseTrack>(*std::move(read));
  const absl::StatusOr<PointLayout> layout = LayoutOf(files->front(), place->sensor);
  if (!layout.ok()) return layout.status();
  if (options.deskew && layout->time == TimeType::kNone) {
    return absl::InvalidArgumentError(
        absl::StrCat(files->front().string(), ": its points have no times: --deskew is not for it"));
  }
  SessionDirectory session;
  for (const fs::path& file : *files) {
    const absl::StatusOr<double> time = TimeOf(file);
    if (!time.ok()) return time.status();
    const std::optional<Pose> pose = track->At(*time);
    if (!pose.has_value()) {
      if (track->empty() || *time < track->first_time() || *time > track->last_time()) continue;
      return absl::InvalidArgumentError(absl::StrFormat("%s: %s has no pose within a second of its time", file.string(),
                                                        place->poses.filename().string()));
    }
    session.files.push_back(file);
    session.poses.push_back(*pose);
    session.times.push_back(*time);
  }
  if (session.files.empty()) {
    return absl::InvalidArgumentError(absl::StrFormat("%s: no scan of %s was taken while there were poses",
                                                      place->poses.string(), place->scans.string()));
  }
  session.read_file = [track, layout = *layout, deskew = options.deskew](const fs::path& file) {
    return ReadPoints(file, layout, deskew ? track.get() : nullptr);
  };
  return session;
}

}  // namespace mapkeep
