#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <functional>
#include <mutex>
#include <span>
#include <vector>

#include "core/geometry/pose.h"
#include "core/geometry/progress.h"
#include "core/geometry/scan.h"
#include "core/voxels/voxel_index.h"

namespace mapkeep {

/// The part [begin, end] of a longer operation's progress that one loop covers.
struct ProgressPart {
  Progress report;  ///< empty: nobody is listening
  double begin = 0;
  double end = 1;
};

/// INVALID_ARGUMENT if there is no scan, the poses do not match the scans, or a pose is not finite.
absl::Status CheckSession(const ScanSource& scans, std::span<const Pose> poses);

/// Calls work(index, scan) for every scan of the source, in parallel on the calling oneTBB arena. The status is that of
/// the failing scan with the lowest index, named in its message, whatever the number of threads; CANCELLED when the
/// progress says stop.
absl::Status ForEachScan(const ScanSource& scans, const ProgressPart& progress,
                         const std::function<absl::Status(size_t index, const Scan& scan)>& work);

/// As ForEachScan, for results that must be put together in order: `work` runs in parallel and leaves what it makes of
/// a scan in the slot that it is given, then `add` takes it from there, one scan at a time in the order of `order` (a
/// permutation of the scans). Slots are numbered below ScanSlots() and are one scan's at a time. The status is that of
/// the failing scan that comes first in `order`.
absl::Status ForEachScanInOrder(const ScanSource& scans, std::span<const uint32_t> order, const ProgressPart& progress,
                                const std::function<absl::Status(size_t index, const Scan& scan, size_t slot)>& work,
                                const std::function<void(size_t index, size_t slot)>& add);

/// How many scans ForEachScanInOrder has in hand at a time.
size_t ScanSlots();

/// The voxel of every point of a scan under a pose, and where the point is in voxel edges. INVALID_ARGUMENT or
/// OUT_OF_RANGE naming the point.
absl::Status VoxelsOfScan(const Scan& scan, const Pose& pose, double voxel_size, std::vector<VoxelIndex>& voxels,
                          std::vector<Eigen::Vector3d>& positions);

/// The sub-voxel of every point, a quarter of the voxel's edge: 4 v .. 4 v + 3 are those of voxel v. Errors likewise.
absl::Status SubVoxelsOfScan(const Scan& scan, const Pose& pose, double voxel_size,
                             std::vector<VoxelIndex>& sub_voxels);

}  // namespace mapkeep
