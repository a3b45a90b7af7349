#pragma once

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "client/mapkeep/map_info.h"
#include "client/mapkeep/session_info.h"

namespace mapkeep {

/// What the commands print with --json. Names and units are those of proto/mapkeep/v1; what is not set is left out.
nlohmann::json JsonOf(const Eigen::Vector3d& point);
nlohmann::json JsonOf(const MapInfo& map);
nlohmann::json JsonOf(const VoxelInfo& voxel);
nlohmann::json JsonOf(const SessionInfo& session);

}  // namespace mapkeep
