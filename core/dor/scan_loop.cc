#include "core/dor/scan_loop.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

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

size_t ScanSlots() { return 2 * static_cast<size_t>(tbb::this_task_arena::max_concurrency()); }

absl::Status ForEachScanInOrder(const ScanSource& scans, std::span<const uint32_t> order, const ProgressPart& progress,
                                const std::function<absl::Status(size_t, const Scan&, size_t)>& work,
                                const std::function<void(size_t, size_t)>& add) {
  struct Item {
    size_t index = 0;
    size_t slot = 0;
    absl::Status status;
  };
  const size_t slots = ScanSlots();
  std::vector<Item> items(slots);
  size_t started = 0;  // of the first stage alone, which runs in order, as the last does
  size_t done = 0;
  absl::Status first_error;        // of the last stage alone
  std::atomic<bool> stop = false;  // nothing more is begun
  // At most `slots` scans are in hand and leave in the order in which they came, so that their slots come round.
  const auto next = [&](tbb::flow_control& control) -> Item* {
    if (started == order.size() || stop.load(std::memory_order_relaxed)) {
      control.stop();
      return nullptr;
    }
    Item& item = items[started % slots];
    item = {order[started], started % slots, absl::OkStatus()};
    ++started;
    return &item;
  };
  const auto process = [&](Item* item) {
    const absl::StatusOr<Scan> scan = scans.read(item->index);
    item->status = scan.ok() ? work(item->index, *scan, item->slot) : scan.status();
    return item;
  };
  const auto take = [&](Item* item) {
    if (!first_error.ok()) return;
    if (item->status.ok()) {
      add(item->index, item->slot);
      ++done;
      const double fraction = static_cast<double>(done) / static_cast<double>(order.size());
      if (!progress.report || progress.report(progress.begin + (progress.end - progress.begin) * fraction)) return;
      first_error = absl::CancelledError("stopped on request");
    } else {
      first_error = InScan(item->index, item->status);
    }
    stop.store(true, std::memory_order_relaxed);
  };
  tbb::parallel_pipeline(slots, tbb::make_filter<void, Item*>(tbb::filter_mode::serial_in_order, next) &
                                    tbb::make_filter<Item*, Item*>(tbb::filter_mode::parallel, process) &
                                    tbb::make_filter<Item*, void>(tbb::filter_mode::serial_in_order, take));
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
