#include "core/dor/scan_loop.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <limits>

namespace mapkeep {
namespace {

// The message with the scan it is about; the code and payloads stay.
absl::Status InScan(size_t index, const absl::Status& status) {
  absl::Status named(status.code(), absl::StrFormat("scan %d: %s", index, status.message()));
  status.ForEachPayload([&](absl::string_view url, const absl::Cord& payload) { named.SetPayload(url, payload); });
  return named;
}

// Largest integer not above a value that is known to fit: what std::floor gives, without a call.
int32_t Floor(double value) {
  const auto truncated = static_cast<int32_t>(value);
  return truncated - (value < truncated ? 1 : 0);
}

// Calls visit(index, position) for every point, positions in voxel edges.
template <typename Visit>
absl::Status ForEachPosition(const Scan& scan, const Pose& pose, double voxel_size, const Visit& visit) {
  if (scan.points.empty()) return absl::InvalidArgumentError("the scan has no points");
  for (size_t i = 0; i < scan.points.size(); ++i) {
    // The same arithmetic as VoxelIndexOf, so that every stage puts a point into the same voxel.
    const Eigen::Vector3d at = (pose * scan.points[i].cast<double>()) / voxel_size;
    constexpr double kLimit = kVoxelLimit;
    const bool fits = at.x() >= -kLimit && at.x() < kLimit && at.y() >= -kLimit && at.y() < kLimit &&
                      at.z() >= -kLimit && at.z() < kLimit;
    if (!fits) {
      const absl::Status status = VoxelIndexOf(pose * scan.points[i].cast<double>(), voxel_size).status();
      return {status.code(), absl::StrFormat("point %d: %s", i, status.message())};
    }
    visit(i, at);
  }
  return absl::OkStatus();
}

VoxelIndex Floor(const Eigen::Vector3d& at) { return {Floor(at.x()), Floor(at.y()), Floor(at.z())}; }

}  // namespace

absl::Status CheckSession(const ScanSource& scans, std::span<const Pose> poses) {
  if (scans.count == 0) return absl::InvalidArgumentError("the session has no scans");
  if (scans.count != poses.size()) {
    return absl::InvalidArgumentError(absl::StrFormat("%d poses for %d scans", poses.size(), scans.count));
  }
  for (size_t i = 0; i < poses.size(); ++i) {
    if (!poses[i].matrix().allFinite()) return absl::InvalidArgumentError(absl::StrFormat("pose %d is not finite", i));
  }
  return absl::OkStatus();
}

absl::Status ForEachScan(const ScanSource& scans, const ProgressPart& progress,
                         const std::function<absl::Status(size_t, const Scan&)>& work) {
  std::mutex mutex;  // guards the three below
  size_t done = 0;
  bool cancelled = false;
  absl::Status first_error;
  // Scans after a failed one are skipped, those before it are not: so the lowest failing index is always found.
  std::atomic<size_t> limit = scans.count;

  tbb::parallel_for(tbb::blocked_range<size_t>(0, scans.count, 1), [&](const tbb::blocked_range<size_t>& range) {
    for (size_t i = range.begin(); i < range.end(); ++i) {
      if (i >= limit.load(std::memory_order_relaxed)) return;
      const absl::StatusOr<Scan> scan = scans.read(i);
      const absl::Status status = scan.ok() ? work(i, *scan) : scan.status();
      const std::lock_guard lock(mutex);
      if (!status.ok() && i < limit.load(std::memory_order_relaxed)) {
        limit.store(i, std::memory_order_relaxed);
        first_error = InScan(i, status);
      }
      ++done;
      if (progress.report && !cancelled && status.ok()) {
        const double fraction = static_cast<double>(done) / static_cast<double>(scans.count);
        if (!progress.report(progress.begin + (progress.end - progress.begin) * fraction)) {
          cancelled = true;
          limit.store(0, std::memory_order_relaxed);
        }
      }
    }
  });
  if (cancelled) return absl::CancelledError("stopped on request");
  return first_error;
}

absl::Status VoxelsOfScan(const Scan& scan, const Pose& pose, double voxel_size, std::vector<VoxelIndex>& voxels,
                          std::vector<Eigen::Vector3d>& positions) {
  voxels.resize(scan.points.size());
  positions.resize(scan.points.size());
  return ForEachPosition(scan, pose, voxel_size, [&](size_t i, const Eigen::Vector3d& at) {
    voxels[i] = Floor(at);
    positions[i] = at;
  });
}

absl::Status SubVoxelsOfScan(const Scan& scan, const Pose& pose, double voxel_size,
                             std::vector<VoxelIndex>& sub_voxels) {
  sub_voxels.resize(scan.points.size());
  // Scaling by a power of two is exact, so that sub-voxels nest in voxels.
  return ForEachPosition(scan, pose, voxel_size,
                         [&](size_t i, const Eigen::Vector3d& at) { sub_voxels[i] = Floor(4 * at); });
}

}  // namespace mapkeep
