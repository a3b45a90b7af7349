#include "server/pipeline/outline.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <numeric>

#include "core/voxels/voxel_index.h"
#include "server/pipeline/parallel.h"

namespace mapkeep {
namespace {

constexpr double kFarFromZero = 10000;  // metres
constexpr double kOriginGrid = 100;     // metres

constexpr double kBlockLimit = kVoxelLimit / kBlockSize;

VoxelIndex BlockAt(const Eigen::Vector3d& point, double block_size) {
  const Eigen::Vector3d cell = (point / block_size).array().floor().cwiseMax(-kBlockLimit).cwiseMin(kBlockLimit - 1);
  return {static_cast<int32_t>(cell.x()), static_cast<int32_t>(cell.y()), static_cast<int32_t>(cell.z())};
}

bool Holds(const BlockRange& range, const VoxelIndex& block) {
  const auto [first, last] = range;
  return first.x <= block.x && block.x <= last.x && first.y <= block.y && block.y <= last.y && first.z <= block.z &&
         block.z <= last.z;
}

BlockRange Union(std::span<const BlockRange> ranges) {
  BlockRange whole = ranges.front();
  for (const auto& [first, last] : ranges) {
    whole.first = {std::min(whole.first.x, first.x), std::min(whole.first.y, first.y),
                   std::min(whole.first.z, first.z)};
    whole.last = {std::max(whole.last.x, last.x), std::max(whole.last.y, last.y), std::max(whole.last.z, last.z)};
  }
  return whole;
}

}  // namespace

absl::StatusOr<SessionOutline> ReadOutline(size_t count, const std::function<absl::StatusOr<StagedScan>(size_t)>& read,
                                           const Progress& progress) {
  SessionOutline outline;
  outline.poses.resize(count);
  outline.extents.resize(count);
  std::vector<uint64_t> points(count);
  std::mutex mutex;
  size_t done = 0;
  const absl::Status status = ParallelFor(count, [&](size_t i) -> absl::Status {
    const absl::StatusOr<StagedScan> staged = read(i);
    if (!staged.ok()) return staged.status();
    outline.poses[i] = staged->pose;
    outline.extents[i] = Eigen::AlignedBox3d(Eigen::Vector3d::Zero());
    for (const Eigen::Vector3f& point : staged->scan.points) outline.extents[i].extend(point.cast<double>());
    points[i] = staged->scan.points.size();
    const std::lock_guard lock(mutex);
    ++done;
    if (progress && !progress(static_cast<double>(done) / static_cast<double>(count))) {
      return absl::CancelledError("stopped while reading scans");
    }
    return absl::OkStatus();
  });
  if (!status.ok()) return status;
  outline.points = std::accumulate(points.begin(), points.end(), uint64_t{0});
  return outline;
}

std::vector<BlockRange> ReachOf(const SessionOutline& outline, std::span<const Pose> poses, double voxel_size,
                                double margin) {
  std::vector<BlockRange> reach;
  reach.reserve(poses.size());
  for (size_t i = 0; i < poses.size(); ++i) {
    const Eigen::AlignedBox3d box = outline.extents[i].transformed(poses[i]);
    const Eigen::Vector3d grown = Eigen::Vector3d::Constant(margin);
    reach.push_back(BlocksOf({box.min() - grown, box.max() + grown}, voxel_size));
  }
  return reach;
}

BlockRange BlocksOf(const Eigen::AlignedBox3d& box, double voxel_size) {
  return {BlockAt(box.min(), kBlockSize * voxel_size), BlockAt(box.max(), kBlockSize * voxel_size)};
}

absl::StatusOr<std::vector<BlockKey>> BlocksWithin(const Snapshot& snapshot, std::span<const BlockRange> ranges) {
  std::vector<BlockKey> within;
  if (ranges.empty()) return within;
  const absl::StatusOr<std::vector<TileKey>> tiles = snapshot.Tiles(Union(ranges));
  if (!tiles.ok()) return tiles.status();
  for (const TileKey tile : *tiles) {
    const absl::StatusOr<std::vector<BlockKey>> blocks = snapshot.BlocksOf(tile);
    if (!blocks.ok()) return blocks.status();
    std::ranges::copy_if(*blocks, std::back_inserter(within), [&](BlockKey key) {
      const VoxelIndex block = BlockIndexOf(key);
      return std::ranges::any_of(ranges, [&](const BlockRange& range) { return Holds(range, block); });
    });
  }
  return within;
}

std::optional<Eigen::Vector3d> OriginFor(const Pose& first) {
  const Eigen::Vector3d position = first.translation();
  if (position.norm() <= kFarFromZero) return {};
  return Eigen::Vector3d((position / kOriginGrid).array().round() * kOriginGrid);
}

}  // namespace mapkeep
