#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Geometry>
#include <string>

#include "client/mapkeep/session_info.h"

namespace mapkeep {

/// "X,Y,Z": three finite numbers. INVALID_ARGUMENT naming the option otherwise.
absl::StatusOr<Eigen::Vector3d> ParsePoint(const std::string& option, const std::string& text);

/// "MINX,MINY,MINZ,MAXX,MAXY,MAXZ", every min below its max.
absl::StatusOr<Eigen::AlignedBox3d> ParseBox(const std::string& option, const std::string& text);

/// "X,Y,Z,YAW": metres and degrees.
absl::StatusOr<KnownStart> ParseInitialPose(const std::string& option, const std::string& text);

/// "X,Y,Z,SIGMA_LEVEL,SIGMA_HEIGHT": metres, both deviations above 0.
absl::StatusOr<GnssStart> ParseGnss(const std::string& option, const std::string& text);

/// A session id from what the session is: the directory's name, made fit for an id, and a checksum of its content. The
/// same scans give the same id, so that an upload repeated is an upload resumed.
std::string SessionIdFrom(const std::string& directory_name, uint32_t content_checksum);

}  // namespace mapkeep
