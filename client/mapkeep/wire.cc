#include "client/mapkeep/wire.h"

#include <absl/status/status.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <limits>
#include <span>
#include <utility>

namespace mapkeep {
namespace {

SessionInfo::State FromWire(v1::SessionState state) {
  switch (state) {
    case v1::SESSION_STATE_UPLOADING:
      return SessionInfo::State::kUploading;
    case v1::SESSION_STATE_QUEUED:
      return SessionInfo::State::kQueued;
    case v1::SESSION_STATE_RUNNING:
      return SessionInfo::State::kRunning;
    case v1::SESSION_STATE_COMMITTED:
      return SessionInfo::State::kCommitted;
    case v1::SESSION_STATE_REFUSED:
      return SessionInfo::State::kRefused;
    case v1::SESSION_STATE_FAILED:
      return SessionInfo::State::kFailed;
    case v1::SESSION_STATE_ROLLED_BACK:
      return SessionInfo::State::kRolledBack;
    default:
      return SessionInfo::State::kUnknown;
  }
}

SessionInfo::Report FromWire(const v1::SessionReport& wire) {
  SessionInfo::Report report{
      .points = wire.points(),
      .points_removed = wire.points_removed(),
      .points_restored = wire.points_restored(),
      .session_voxels = wire.session_voxels(),
      .voxels_kept = wire.voxels_kept(),
      .static_voxels = wire.static_voxels(),
      .blocks_touched = wire.blocks_touched(),
      .base_epoch = wire.base_epoch(),
      .epoch = wire.epoch(),
  };
  for (const v1::Window& window : wire.windows()) {
    report.windows.push_back({.first_scan = window.first_scan(),
                              .last_scan = window.last_scan(),
                              .fitness = window.fitness(),
                              .inliers = window.inliers(),
                              .correction = window.correction(),
                              .rotation = window.rotation(),
                              .observability = window.observability(),
                              .precision = window.precision(),
                              .coverage = window.coverage(),
                              .trusted = window.trusted()});
  }
  for (const v1::StageTime& stage : wire.stages()) report.stages.push_back({stage.stage(), stage.seconds()});
  return report;
}

}  // namespace

std::string_view NameOf(SessionInfo::State state) {
  switch (state) {
    case SessionInfo::State::kUploading:
      return "uploading";
    case SessionInfo::State::kQueued:
      return "queued";
    case SessionInfo::State::kRunning:
      return "running";
    case SessionInfo::State::kCommitted:
      return "committed";
    case SessionInfo::State::kRefused:
      return "refused";
    case SessionInfo::State::kFailed:
      return "failed";
    case SessionInfo::State::kRolledBack:
      return "rolled back";
    case SessionInfo::State::kUnknown:
      break;
  }
  return "unknown";
}

Eigen::Vector3d FromWire(const v1::Point& point) { return {point.x(), point.y(), point.z()}; }

MapInfo FromWire(const v1::Map& map) {
  MapInfo info{.name = map.name(),
               .voxel_size = map.voxel_size(),
               .origin = {},
               .crs = map.crs(),
               .epoch = map.epoch(),
               .created = map.created(),
               .voxels = map.voxels(),
               .static_voxels = map.static_voxels(),
               .blocks = map.blocks(),
               .tiles = map.tiles(),
               .bounds = {},
               .sessions = map.sessions()};
  if (map.has_origin()) info.origin = FromWire(map.origin());
  if (map.has_bounds()) info.bounds.emplace(FromWire(map.bounds().min()), FromWire(map.bounds().max()));
  return info;
}

VoxelInfo FromWire(const v1::QueryVoxelResponse& voxel) {
  return {.epoch = voxel.epoch(),
          .hits = voxel.hits(),
          .exposures = voxel.exposures(),
          .stability = voxel.stability(),
          .ground = voxel.ground(),
          .is_static = voxel.is_static(),
          .is_new = voxel.is_new(),
          .first_seen = voxel.first_seen(),
          .last_seen = voxel.last_seen(),
          .mean = FromWire(voxel.mean()),
          .intensity = voxel.intensity()};
}

SessionInfo FromWire(const v1::Session& session) {
  SessionInfo info{.map = session.map(),
                   .id = session.id(),
                   .robot = session.robot(),
                   .state = FromWire(session.state()),
                   .scan_count = session.scan_count(),
                   .durable_scans = session.durable_scans(),
                   .keep_scans = session.keep_scans(),
                   .created = session.created(),
                   .ended = session.ended(),
                   .start_time = session.start_time(),
                   .stage = session.stage(),
                   .stage_progress = session.stage_progress(),
                   .reason = session.reason(),
                   .payload_bytes = session.payload_bytes(),
                   .report = {}};
  if (session.has_report()) info.report = FromWire(session.report());
  return info;
}

MapSnapshot FromWire(const v1::TileStreamHeader& header) {
  MapSnapshot snapshot{.epoch = header.epoch(), .voxel_size = header.voxel_size(), .origin = {}, .crs = header.crs()};
  if (header.has_origin()) snapshot.origin = FromWire(header.origin());
  return snapshot;
}

absl::StatusOr<Pose> FromWire(const v1::Pose& pose) {
  if (pose.rows_size() != 12) {
    return absl::DataLossError(absl::StrFormat("the server sent a pose of %d values, not 12", pose.rows_size()));
  }
  absl::StatusOr<Pose> parsed = PoseFromRows(std::span<const double, 12>(pose.rows().data(), 12));
  if (!parsed.ok()) return absl::DataLossError(parsed.status().message());
  return parsed;
}

absl::StatusOr<Block> FromWire(const v1::VoxelBlock& wire) {
  constexpr uint32_t kPositions = kBlockSize * kBlockSize * kBlockSize;
  const auto damaged = [&wire](std::string_view what) {
    return absl::DataLossError(
        absl::StrFormat("block (%d, %d, %d) from the server: %s", wire.x(), wire.y(), wire.z(), what));
  };
  const VoxelIndex index{wire.x(), wire.y(), wire.z()};
  constexpr int32_t kLimit = kVoxelLimit >> kBlockBits;
  for (const int32_t c : {index.x, index.y, index.z}) {
    if (c < -kLimit || c >= kLimit) return damaged("its index is out of range");
  }
  const size_t count = wire.positions_size();
  const auto fits = [count](auto size, size_t entries_a_voxel) {
    return static_cast<size_t>(size) == count * entries_a_voxel;
  };
  if (!fits(wire.hits_size(), 1) || !fits(wire.exposures_size(), 1) || !fits(wire.flags().size(), 1) ||
      !fits(wire.means().size(), 3) || !fits(wire.normals().size(), 2) || !fits(wire.intensities().size(), 1) ||
      !fits(wire.masks_size(), 1) || !fits(wire.first_seen_size(), 1) || !fits(wire.last_seen_size(), 1)) {
    return damaged("its columns differ in length");
  }
  Block block{BlockKeyOf(index), {}};
  block.voxels.reserve(count);
  const auto byte = [](const std::string& bytes, size_t i) { return static_cast<uint8_t>(bytes[i]); };
  constexpr uint32_t kMostCount = std::numeric_limits<uint16_t>::max();
  for (size_t i = 0; i < count; ++i) {
    const int row = static_cast<int>(i);
    const uint32_t position = wire.positions(row);
    if (position >= kPositions || (row > 0 && position <= wire.positions(row - 1))) {
      return damaged("its positions are not sorted");
    }
    if (std::max(wire.hits(row), wire.exposures(row)) > kMostCount) return damaged("a count is out of range");
    block.voxels.push_back(
        {.position = static_cast<uint16_t>(position),
         .hits = static_cast<uint16_t>(wire.hits(row)),
         .exposures = static_cast<uint16_t>(wire.exposures(row)),
         .ground = (byte(wire.flags(), i) & 1) != 0,
         .is_static = (byte(wire.flags(), i) & 2) != 0,
         .is_new = (byte(wire.flags(), i) & 4) != 0,
         .mean = {byte(wire.means(), 3 * i), byte(wire.means(), 3 * i + 1), byte(wire.means(), 3 * i + 2)},
         .normal = {byte(wire.normals(), 2 * i), byte(wire.normals(), 2 * i + 1)},
         .intensity = byte(wire.intensities(), i),
         .mask = wire.masks(row),
         .first_seen = wire.first_seen(row),
         .last_seen = wire.last_seen(row)});
  }
  return block;
}

v1::PointFormat ToWire(PayloadFormat format) {
  return format == PayloadFormat::kDraco ? v1::POINT_FORMAT_DRACO : v1::POINT_FORMAT_FLOAT32;
}

void ToWire(const Eigen::Vector3d& point, v1::Point* wire) {
  wire->set_x(point.x());
  wire->set_y(point.y());
  wire->set_z(point.z());
}

v1::InitialPose ToWire(const KnownStart& start) {
  v1::InitialPose wire;
  ToWire(Eigen::Vector3d(start.x, start.y, start.z), wire.mutable_position());
  wire.set_yaw(start.yaw);
  return wire;
}

v1::GnssPosition ToWire(const GnssStart& start) {
  v1::GnssPosition wire;
  ToWire(Eigen::Vector3d(start.x, start.y, start.z), wire.mutable_position());
  const double level = start.level_sigma * start.level_sigma, height = start.height_sigma * start.height_sigma;
  for (const double value : {level, 0.0, 0.0, 0.0, level, 0.0, 0.0, 0.0, height}) wire.add_covariance(value);
  return wire;
}

void ToWire(const Eigen::AlignedBox3d& box, v1::Box* wire) {
  ToWire(box.min(), wire->mutable_min());
  ToWire(box.max(), wire->mutable_max());
}

void ToWire(const Pose& pose, v1::Pose* wire) {
  const PoseRows rows = RowsOf(pose);
  wire->mutable_rows()->Assign(rows.begin(), rows.end());
}

v1::CreateMapRequest ToWire(const NewMap& map) {
  v1::CreateMapRequest request;
  request.set_name(map.name);
  request.set_voxel_size(map.voxel_size);
  if (map.origin.has_value()) ToWire(*map.origin, request.mutable_origin());
  request.set_crs(map.crs);
  return request;
}

v1::VoxelBlock ToWire(const Block& block) {
  v1::VoxelBlock wire;
  const VoxelIndex index = BlockIndexOf(block.key);
  wire.set_x(index.x);
  wire.set_y(index.y);
  wire.set_z(index.z);
  for (const Voxel& voxel : block.voxels) {
    wire.add_positions(voxel.position);
    wire.add_hits(voxel.hits);
    wire.add_exposures(voxel.exposures);
    wire.mutable_flags()->push_back(
        static_cast<char>((voxel.ground ? 1 : 0) | (voxel.is_static ? 2 : 0) | (voxel.is_new ? 4 : 0)));
    wire.mutable_means()->append(voxel.mean.begin(), voxel.mean.end());
    wire.mutable_normals()->append(voxel.normal.begin(), voxel.normal.end());
    wire.mutable_intensities()->push_back(static_cast<char>(voxel.intensity));
    wire.add_masks(voxel.mask);
    wire.add_first_seen(voxel.first_seen);
    wire.add_last_seen(voxel.last_seen);
  }
  return wire;
}

}  // namespace mapkeep
