#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/scan.h"

namespace mapkeep {

/// How a session lies in a directory; one file a layout, see README.md.
enum class SessionLayout : uint8_t {
  kKitti,   ///< velodyne/*.bin, poses.txt, optional calib.txt and times.txt
  kElite,   ///< Scans/*.pcd in the sensor frame, poses.txt
  kKth,     ///< pcd/*.pcd in the world frame, the sensor pose in VIEWPOINT
  kMulran,  ///< Ouster/*.bin named by their time, global_pose.csv
  kRosBag,  ///< a ROS 1 bag, or a directory of them
  kMcap,    ///< an MCAP file (ROS 2), or a directory of them
};

/// What to take of a session that leaves a choice, and how.
struct SessionOptions {
  std::optional<SessionLayout> layout;  ///< nothing: told by what is there
  bool deskew = false;                  ///< move points to their scan's time, where the layout has their times
  std::string points_topic;             ///< of a recording; empty: the one with the most clouds
  std::string poses_topic;              ///< of a recording; empty: Odometry, PoseStamped or tf, whichever comes first
  std::string fixed_frame;              ///< of a recording: poses are those of tf in this frame
  bool poses_are_of_sensor = false;     ///< of a recording: whatever their frame says
};

/// A session in a directory or a recording: everything but the points, which are read on demand. The columns hold one
/// entry a scan.
struct SessionDirectory {
  std::filesystem::path path;
  SessionLayout layout = SessionLayout::kKitti;
  std::vector<std::filesystem::path> files;  ///< of a recording: its path, topic and the number of the message
  std::vector<Pose> poses;                   ///< T_session_sensor
  std::vector<double> times;                 ///< start of the sweep, seconds since 1970 (UTC); empty: unknown
  /// Reads a scan as the file has it, in the sensor frame. Thread-safe.
  std::function<absl::StatusOr<Scan>(const std::filesystem::path& file)> read_file;
  uint64_t bytes = 0;             ///< of all clouds of a recording; 0: those of the files
  bool nan_is_no_return = false;  ///< the layout marks a missing return by NaN coordinates
  float intensity_scale = 1;      ///< what makes the file's intensities [0, 1]
};

/// A scan without the points that are no returns.
struct CheckedScan {
  Scan scan;
  std::vector<uint32_t> no_returns;  ///< their positions in the file, ascending
};

inline constexpr float kNoReturnRange = 0.1F;       ///< metres: nearer than this is no return, but the sensor itself
inline constexpr float kFarthestReturn = 10'000.F;  ///< metres: no LiDAR sees farther, so the file is damaged
inline constexpr size_t kMostPoints = 4'000'000;    ///< of a scan (proto: ScanHeader.point_count)

std::string_view NameOf(SessionLayout layout);
/// INVALID_ARGUMENT listing the layouts.
absl::StatusOr<SessionLayout> LayoutNamed(std::string_view name);

/// Opens a session; without options.layout it is told by the folders in the directory, or by how the file begins. Every
/// error of this and of ReadScan is INVALID_ARGUMENT or NOT_FOUND and begins with the file at fault (and its line): a
/// directory that is no session, counts that do not match, a short row, a pose that is not finite or no rotation.
///
/// Intensities: when the largest of the first scan is at most 1 they are taken as they are, up to 255 they are divided
/// by 255, above that by 65535; whatever then lies outside [0, 1] is clamped. Times that do not count from 1970 (the
/// first is below 1e9 s; KITTI's own begin at 0) say nothing about when that was, and are left out.
absl::StatusOr<SessionDirectory> OpenSessionDirectory(const std::filesystem::path& path,
                                                      const SessionOptions& options = {});

/// Reads and checks scan `index`. Points nearer than kNoReturnRange are left out. An error for a file that is missing,
/// truncated or empty, and for a point that is not finite or farther than kFarthestReturn.
absl::StatusOr<CheckedScan> ReadScan(const SessionDirectory& directory, size_t index);

/// The scans of the directory, by ReadScan.
ScanSource SourceOf(SessionDirectory directory);

}  // namespace mapkeep
