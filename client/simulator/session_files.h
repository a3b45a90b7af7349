#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <filesystem>

#include "client/readers/session_directory.h"
#include "client/simulator/session.h"
#include "core/geometry/progress.h"

namespace mapkeep {

/// How the points of a PCD file are written.
enum class PcdEncoding : uint8_t { kBinary, kAscii, kCompressed };

/// Writes a session to a directory that does not exist yet, in one of the layouts that readers know:
///
/// - kKitti: velodyne/NNNNNN.bin, label/NNNNNN.label (251 moving, 9 static, 0 unsure; high half: the object's id),
/// poses.txt;
/// - kElite: Scans/NNNNNN.pcd in the sensor frame, poses.txt;
/// - kKth: pcd/NNNNNN.pcd in the frame of the odometry, its pose in VIEWPOINT, and gt_cloud.pcd with all points of the
///   session that are not unsure, intensity 1 for moving ones and 0 for static ones.
///
/// Poses are the odometry. Beside them, in any layout: times.txt (seconds since 1970), truth_poses.txt (in the common
/// frame) and objects.json (see WriteObjects). The directory gets its name when all is written; until then it is hidden
/// beside it as
/// `.NAME.partial` (one that an interrupted run left is replaced). ALREADY_EXISTS, CANCELLED, or an error naming the
/// file.
absl::Status WriteSession(const SimulatedSession& session, const std::filesystem::path& directory, SessionLayout layout,
                          PcdEncoding encoding = PcdEncoding::kBinary, const Progress& progress = {});

}  // namespace mapkeep
