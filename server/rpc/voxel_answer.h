#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>

#include "mapkeep/v1/map_service.pb.h"
#include "storage/map_store.h"

namespace mapkeep {

/// What an epoch holds at a point, metres relative to the map's origin. NOT_FOUND if that voxel was never hit,
/// OUT_OF_RANGE beyond the map's range.
absl::StatusOr<v1::QueryVoxelResponse> VoxelAt(const Snapshot& snapshot, const Eigen::Vector3d& point, double eta);

}  // namespace mapkeep
