#include "client/exporters/spooled_points.h"

#include <algorithm>
#include <type_traits>

namespace mapkeep {
namespace {

static_assert(std::is_trivially_copyable_v<TilePoint>);
constexpr uint32_t kMinutesADay = 24 * 60;

/// The bit of the sub-voxel that holds the voxel's mean.
uint64_t BitOfMean(const Voxel& voxel) {
  return uint64_t{1} << (voxel.mean[0] / 64 + 4 * (voxel.mean[1] / 64) + 16 * (voxel.mean[2] / 64));
}

uint64_t MaskInside(const Block& block, const Voxel& voxel, double voxel_size, const Eigen::AlignedBox3d& box) {
  const Eigen::Vector3d corner = CornerOf(VoxelIndexOf(VoxelKeyOf(block.key, voxel.position)), voxel_size);
  uint64_t mask = 0;
  for (int bit = 0; bit < 64; ++bit) {
    const Eigen::Vector3d cell(bit % 4 + 0.5, bit / 4 % 4 + 0.5, bit / 16 + 0.5);
    const Eigen::Vector3d point = corner + cell * (voxel_size / 4);
    const bool inside = (point.array() >= box.min().array()).all() && (point.array() < box.max().array()).all();
    mask |= inside ? uint64_t{1} << bit : 0;
  }
  return mask;
}

}  // namespace

Block Selected(const Block& block, double voxel_size, const ExportOptions& options) {
  if (!options.box.has_value() && options.detail == PointDetail::kSubVoxels) return block;
  Block selected{block.key, {}};
  for (Voxel voxel : block.voxels) {
    if (options.detail == PointDetail::kCentroids) voxel.mask = BitOfMean(voxel);
    if (options.box.has_value()) voxel.mask &= MaskInside(block, voxel, voxel_size, *options.box);
    if (voxel.mask != 0) selected.voxels.push_back(voxel);
  }
  return selected;
}

absl::StatusOr<SpooledPoints> SpooledPoints::Create(const std::filesystem::path& beside) {
  absl::StatusOr<SpoolFile> spool = SpoolFile::Create(beside);
  if (!spool.ok()) return spool.status();
  return SpooledPoints(*std::move(spool));
}

void SpooledPoints::See(const Block& block) {
  for (const Voxel& voxel : block.voxels) {
    newest_day_ =
        std::max(newest_day_, static_cast<uint16_t>(std::min<uint32_t>(voxel.last_seen / kMinutesADay, 65535)));
  }
}

absl::StatusOr<SpooledPoints::Part> SpooledPoints::Add(std::span<const TilePoint> points) {
  const Part part{spool_.size(), points.size()};
  absl::Status status = spool_.Append({reinterpret_cast<const char*>(points.data()), points.size_bytes()});
  if (!status.ok()) return status;
  return part;
}

absl::StatusOr<std::vector<TilePoint>> SpooledPoints::Read(const Part& part) {
  std::vector<TilePoint> points(part.count);
  absl::Status status =
      spool_.Read(part.offset, reinterpret_cast<char*>(points.data()), points.size() * sizeof(TilePoint));
  if (!status.ok()) return status;
  return points;
}

}  // namespace mapkeep
