#pragma once

#include <absl/status/statusor.h>

#include "client/mapkeep/map_info.h"
#include "client/mapkeep/session_info.h"
#include "core/geometry/pose.h"
#include "core/scan_payload/scan_payload.h"
#include "core/voxels/block.h"
#include "mapkeep/v1/common.pb.h"
#include "mapkeep/v1/map_service.pb.h"
#include "mapkeep/v1/session_service.pb.h"
#include "mapkeep/v1/tile_service.pb.h"

namespace mapkeep {

Eigen::Vector3d FromWire(const v1::Point& point);
MapInfo FromWire(const v1::Map& map);
VoxelInfo FromWire(const v1::QueryVoxelResponse& voxel);
SessionInfo FromWire(const v1::Session& session);
MapSnapshot FromWire(const v1::TileStreamHeader& header);
/// DATA_LOSS if it does not have 12 values or is no rigid motion.
absl::StatusOr<Pose> FromWire(const v1::Pose& pose);
/// DATA_LOSS naming the block if its columns differ in length or its positions are not sorted.
absl::StatusOr<Block> FromWire(const v1::VoxelBlock& block);

v1::PointFormat ToWire(PayloadFormat format);
void ToWire(const Eigen::Vector3d& point, v1::Point* wire);
v1::InitialPose ToWire(const KnownStart& start);
v1::GnssPosition ToWire(const GnssStart& start);
void ToWire(const Eigen::AlignedBox3d& box, v1::Box* wire);
void ToWire(const Pose& pose, v1::Pose* wire);
v1::CreateMapRequest ToWire(const NewMap& map);
v1::VoxelBlock ToWire(const Block& block);

}  // namespace mapkeep
