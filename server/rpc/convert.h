#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>

#include "core/changes/changed_objects.h"
#include "core/geometry/pose.h"
#include "core/voxels/block.h"
#include "mapkeep/v1/map_service.pb.h"
#include "mapkeep/v1/session_service.pb.h"
#include "mapkeep/v1/tile_service.pb.h"
#include "server/pipeline/session_feed.h"
#include "storage/map_store.h"
#include "storage/session_store.h"

namespace mapkeep {

v1::Map ToProto(const Snapshot& snapshot);
v1::Version ToProto(const MapVersion& version);
v1::Session ToProto(const SessionRecord& session, const std::optional<StageProgress>& progress);
v1::Pose ToProto(const Pose& pose);
v1::Point ToProto(const Eigen::Vector3d& point);
v1::ChangedObject ToProto(const ChangedObject& object);

/// INVALID_ARGUMENT naming `what` if a coordinate is not finite.
absl::StatusOr<Eigen::Vector3d> FromProto(const v1::Point& point, const std::string& what);

/// INVALID_ARGUMENT unless it is 12 finite values whose 3x3 is a rotation.
absl::StatusOr<Pose> FromProto(const v1::Pose& pose);

/// Voxels whose centre lies in a box (min inside, max not), so that boxes that share a face share no voxel. Both ends
/// inclusive; a range without voxels has last < first in an axis.
struct VoxelRange {
  VoxelIndex first, last;

  bool Holds(const VoxelIndex& voxel) const;
  /// False if no voxel can be in it.
  bool HasVoxels() const;
  BlockRange Blocks() const;
};

/// INVALID_ARGUMENT if a value is not finite or a min is not below its max.
absl::StatusOr<VoxelRange> FromProto(const v1::Box& box, double voxel_size);

/// The block's voxels that are in the range (all: no range), or nothing if there is none; only static ones unless
/// `include_all`.
std::optional<v1::VoxelBlock> ToProto(const Block& block, const std::optional<VoxelRange>& range, bool include_all);

/// INVALID_ARGUMENT naming the block if it is none that a map can have: columns of different lengths, positions that
/// are not sorted, an index out of range, no voxels, a voxel that was hardly hit or holds no point.
absl::StatusOr<Block> FromProto(const v1::VoxelBlock& block);

/// Seconds since 1970 (UTC) of minutes since 2000-01-01 UTC.
double SecondsSince1970(uint32_t minutes_since_2000);

}  // namespace mapkeep
