#include "server/rpc/convert.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace mapkeep {
namespace {

constexpr double kSecondsBetween1970And2000 = 946684800;

v1::SessionState ToProto(SessionState state) {
  switch (state) {
    case SessionState::kUploading:
      return v1::SESSION_STATE_UPLOADING;
    case SessionState::kQueued:
      return v1::SESSION_STATE_QUEUED;
    case SessionState::kRunning:
      return v1::SESSION_STATE_RUNNING;
    case SessionState::kCommitted:
      return v1::SESSION_STATE_COMMITTED;
    case SessionState::kRefused:
      return v1::SESSION_STATE_REFUSED;
    case SessionState::kFailed:
      return v1::SESSION_STATE_FAILED;
    case SessionState::kRolledBack:
      return v1::SESSION_STATE_ROLLED_BACK;
  }
  return v1::SESSION_STATE_UNSPECIFIED;
}

v1::ChangeClass ToProto(ChangeClass change) {
  switch (change) {
    case ChangeClass::kAppeared:
      return v1::CHANGE_CLASS_APPEARED;
    case ChangeClass::kDisappeared:
      return v1::CHANGE_CLASS_DISAPPEARED;
    case ChangeClass::kUnstable:
      return v1::CHANGE_CLASS_UNSTABLE;
  }
  return v1::CHANGE_CLASS_UNSPECIFIED;
}

v1::SessionReport ToProto(const SessionReport& report) {
  v1::SessionReport proto;
  for (const WindowResult& window : report.windows) {
    v1::Window& to = *proto.add_windows();
    to.set_first_scan(window.first_scan);
    to.set_last_scan(window.last_scan);
    to.set_fitness(window.fitness);
    to.set_inliers(window.inliers);
    to.set_correction(window.correction);
    to.set_rotation(window.rotation);
    to.set_observability(window.observability);
    to.set_trusted(window.trusted);
    to.set_precision(window.precision);
    to.set_coverage(window.coverage);
  }
  for (const StageTime& stage : report.stages) {
    v1::StageTime& to = *proto.add_stages();
    to.set_stage(stage.stage);
    to.set_seconds(stage.seconds);
  }
  proto.set_points(report.points);
  proto.set_points_removed(report.points_removed);
  proto.set_points_restored(report.points_restored);
  proto.set_session_voxels(report.session_voxels);
  proto.set_voxels_kept(report.voxels_kept);
  proto.set_static_voxels(report.static_voxels);
  proto.set_blocks_touched(report.blocks_touched);
  proto.set_base_epoch(report.base_epoch);
  proto.set_epoch(report.epoch);
  return proto;
}

// The index of the first voxel whose centre is not below `coordinate`.
int32_t FirstVoxelFrom(double coordinate, double voxel_size) {
  const double index = std::ceil(coordinate / voxel_size - 0.5);
  return static_cast<int32_t>(std::clamp<double>(index, -kVoxelLimit, kVoxelLimit));
}

}  // namespace

v1::Map ToProto(const Snapshot& snapshot) {
  const MapRecord& map = snapshot.map();
  v1::Map proto;
  proto.set_name(map.name);
  proto.set_voxel_size(map.voxel_size);
  if (map.origin) *proto.mutable_origin() = ToProto(*map.origin);
  proto.set_crs(map.crs);
  proto.set_epoch(snapshot.epoch());
  proto.set_created(map.created);
  const MapTotals& totals = snapshot.totals();
  proto.set_voxels(totals.voxels);
  proto.set_static_voxels(totals.static_voxels);
  proto.set_blocks(totals.blocks);
  proto.set_tiles(totals.tiles);
  if (const auto bounds = snapshot.bounds()) {
    const double block_size = map.voxel_size * kBlockSize;
    const auto [first, last] = *bounds;
    *proto.mutable_bounds()->mutable_min() = ToProto(CornerOf(first, block_size));
    *proto.mutable_bounds()->mutable_max() = ToProto(CornerOf({last.x + 1, last.y + 1, last.z + 1}, block_size));
  }
  proto.set_sessions(snapshot.sessions());
  return proto;
}

v1::Version ToProto(const MapVersion& version) {
  v1::Version proto;
  proto.set_epoch(version.commit.epoch);
  proto.set_session(version.commit.session);
  proto.set_base_epoch(version.commit.base_epoch);
  proto.set_rollback(version.commit.rollback);
  proto.set_time(version.commit.time);
  proto.set_touched_tiles(version.commit.touched_tiles.size());
  proto.set_readable(version.readable);
  if (version.totals) {
    proto.set_voxels(version.totals->voxels);
    proto.set_static_voxels(version.totals->static_voxels);
    proto.set_sessions(version.sessions);
  }
  for (const std::string& tag : version.tags) proto.add_tags(tag);
  return proto;
}

v1::Session ToProto(const SessionRecord& session, const std::optional<StageProgress>& progress) {
  v1::Session proto;
  proto.set_map(session.map);
  proto.set_id(session.id);
  proto.set_robot(session.robot);
  proto.set_state(ToProto(session.state));
  proto.set_scan_count(static_cast<uint32_t>(session.scan_crc32c.size()));
  proto.set_durable_scans(session.durable_scans);
  proto.set_keep_scans(session.keep_scans);
  proto.set_created(session.created);
  proto.set_ended(session.ended);
  proto.set_start_time(session.start_time);
  if (session.state == SessionState::kRunning && progress) {
    proto.set_stage(progress->stage);
    proto.set_stage_progress(std::clamp(progress->fraction, 0.0, 1.0));
  }
  proto.set_reason(session.reason);
  proto.set_payload_bytes(session.payload_bytes);
  if (session.state >= SessionState::kRunning) *proto.mutable_report() = ToProto(session.report);
  return proto;
}

v1::Pose ToProto(const Pose& pose) {
  const PoseRows rows = RowsOf(pose);
  v1::Pose proto;
  proto.mutable_rows()->Add(rows.begin(), rows.end());
  return proto;
}

v1::Point ToProto(const Eigen::Vector3d& point) {
  v1::Point proto;
  proto.set_x(point.x());
  proto.set_y(point.y());
  proto.set_z(point.z());
  return proto;
}

v1::ChangedObject ToProto(const ChangedObject& object) {
  v1::ChangedObject proto;
  proto.set_change(ToProto(object.change));
  proto.set_voxels(object.voxels);
  *proto.mutable_box()->mutable_min() = ToProto(Eigen::Vector3d(object.box.min()));
  *proto.mutable_box()->mutable_max() = ToProto(Eigen::Vector3d(object.box.max()));
  *proto.mutable_centre() = ToProto(object.centre);
  return proto;
}

absl::StatusOr<Eigen::Vector3d> FromProto(const v1::Point& point, const std::string& what) {
  const Eigen::Vector3d value(point.x(), point.y(), point.z());
  if (!value.allFinite()) return absl::InvalidArgumentError(absl::StrCat(what, ": a coordinate is not finite"));
  return value;
}

absl::StatusOr<Pose> FromProto(const v1::Pose& pose) {
  if (pose.rows_size() != 12) {
    return absl::InvalidArgumentError(absl::StrFormat("the pose has %d values, expected 12", pose.rows_size()));
  }
  return PoseFromRows(std::span<const double, 12>(pose.rows().data(), 12));
}

bool VoxelRange::Holds(const VoxelIndex& voxel) const {
  return first.x <= voxel.x && voxel.x <= last.x && first.y <= voxel.y && voxel.y <= last.y && first.z <= voxel.z &&
         voxel.z <= last.z;
}

bool VoxelRange::HasVoxels() const { return first.x <= last.x && first.y <= last.y && first.z <= last.z; }

BlockRange VoxelRange::Blocks() const { return {BlockOf(first), BlockOf(last)}; }

absl::StatusOr<VoxelRange> FromProto(const v1::Box& box, double voxel_size) {
  const auto min = FromProto(box.min(), "box min");
  if (!min.ok()) return min.status();
  const auto max = FromProto(box.max(), "box max");
  if (!max.ok()) return max.status();
  if (!(min->array() < max->array()).all()) {
    return absl::InvalidArgumentError("box: expected every coordinate of min below that of max");
  }
  VoxelRange range;
  range.first = {FirstVoxelFrom(min->x(), voxel_size), FirstVoxelFrom(min->y(), voxel_size),
                 FirstVoxelFrom(min->z(), voxel_size)};
  range.last = {FirstVoxelFrom(max->x(), voxel_size) - 1, FirstVoxelFrom(max->y(), voxel_size) - 1,
                FirstVoxelFrom(max->z(), voxel_size) - 1};
  return range;
}

std::optional<v1::VoxelBlock> ToProto(const Block& block, const std::optional<VoxelRange>& range, bool include_all) {
  v1::VoxelBlock proto;
  std::string flags, means, normals, intensities;
  for (const Voxel& voxel : block.voxels) {
    if (!include_all && !voxel.is_static) continue;
    if (range && !range->Holds(VoxelIndexOf(VoxelKeyOf(block.key, voxel.position)))) continue;
    proto.add_positions(voxel.position);
    proto.add_hits(voxel.hits);
    proto.add_exposures(voxel.exposures);
    flags.push_back(static_cast<char>((voxel.ground ? 1 : 0) | (voxel.is_static ? 2 : 0) | (voxel.is_new ? 4 : 0)));
    means.append(voxel.mean.begin(), voxel.mean.end());
    normals.append(voxel.normal.begin(), voxel.normal.end());
    intensities.push_back(static_cast<char>(voxel.intensity));
    proto.add_masks(voxel.mask);
    proto.add_first_seen(voxel.first_seen);
    proto.add_last_seen(voxel.last_seen);
  }
  if (proto.positions().empty()) return {};
  const VoxelIndex index = BlockIndexOf(block.key);
  proto.set_x(index.x);
  proto.set_y(index.y);
  proto.set_z(index.z);
  proto.set_flags(std::move(flags));
  proto.set_means(std::move(means));
  proto.set_normals(std::move(normals));
  proto.set_intensities(std::move(intensities));
  return proto;
}

absl::StatusOr<Block> FromProto(const v1::VoxelBlock& proto) {
  constexpr uint32_t kPositions = kBlockSize * kBlockSize * kBlockSize;
  const auto wrong = [&proto](std::string_view what) {
    return absl::InvalidArgumentError(absl::StrFormat("block (%d, %d, %d): %s", proto.x(), proto.y(), proto.z(), what));
  };
  constexpr int32_t kLimit = kVoxelLimit >> kBlockBits;
  for (const int32_t c : {proto.x(), proto.y(), proto.z()}) {
    if (c < -kLimit || c >= kLimit) return wrong("its index is out of range");
  }
  const auto count = static_cast<size_t>(proto.positions_size());
  if (count == 0) return wrong("it has no voxels");
  const auto fits = [count](auto size, size_t entries_a_voxel) {
    return static_cast<size_t>(size) == count * entries_a_voxel;
  };
  if (!fits(proto.hits_size(), 1) || !fits(proto.exposures_size(), 1) || !fits(proto.flags().size(), 1) ||
      !fits(proto.means().size(), 3) || !fits(proto.normals().size(), 2) || !fits(proto.intensities().size(), 1) ||
      !fits(proto.masks_size(), 1) || !fits(proto.first_seen_size(), 1) || !fits(proto.last_seen_size(), 1)) {
    return wrong("its columns differ in length");
  }
  Block block{BlockKeyOf(VoxelIndex{proto.x(), proto.y(), proto.z()}), {}};
  block.voxels.reserve(count);
  const auto byte = [](const std::string& bytes, size_t i) { return static_cast<uint8_t>(bytes[i]); };
  for (size_t i = 0; i < count; ++i) {
    const int row = static_cast<int>(i);
    const uint32_t position = proto.positions(row);
    if (position >= kPositions || (row > 0 && position <= proto.positions(row - 1))) {
      return wrong("its positions are not sorted");
    }
    if (std::max(proto.hits(row), proto.exposures(row)) > std::numeric_limits<uint16_t>::max()) {
      return wrong("a count is out of range");
    }
    const Voxel voxel{
        .position = static_cast<uint16_t>(position),
        .hits = static_cast<uint16_t>(proto.hits(row)),
        .exposures = static_cast<uint16_t>(proto.exposures(row)),
        .ground = (byte(proto.flags(), i) & 1) != 0,
        .is_static = (byte(proto.flags(), i) & 2) != 0,
        .is_new = (byte(proto.flags(), i) & 4) != 0,
        .mean = {byte(proto.means(), 3 * i), byte(proto.means(), 3 * i + 1), byte(proto.means(), 3 * i + 2)},
        .normal = {byte(proto.normals(), 2 * i), byte(proto.normals(), 2 * i + 1)},
        .intensity = byte(proto.intensities(), i),
        .mask = proto.masks(row),
        .first_seen = proto.first_seen(row),
        .last_seen = proto.last_seen(row)};
    // What holds of every voxel that a merge has made.
    if (voxel.hits < kCountScale / 4) return wrong("a voxel was hit in less than a quarter of a scan");
    if (voxel.mask == 0) return wrong("a voxel holds no point");
    if (voxel.first_seen > voxel.last_seen) return wrong("a voxel was last seen before it was first");
    block.voxels.push_back(voxel);
  }
  return block;
}

double SecondsSince1970(uint32_t minutes_since_2000) { return kSecondsBetween1970And2000 + 60.0 * minutes_since_2000; }

}  // namespace mapkeep
