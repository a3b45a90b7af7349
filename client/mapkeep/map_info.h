#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/changes/changed_objects.h"
#include "core/voxels/block.h"

namespace mapkeep {

/// What a map is to be; see CreateMapRequest.
struct NewMap {
  std::string name;
  double voxel_size = 0.2;                ///< metres
  std::optional<Eigen::Vector3d> origin;  ///< metres; without it a first session far from zero chooses one
  std::string crs;                        ///< "EPSG:N" or empty
};

/// A map as of one epoch. Coordinates are metres relative to the origin.
struct MapInfo {
  std::string name;
  double voxel_size = 0;                  ///< metres
  std::optional<Eigen::Vector3d> origin;  ///< in the frame of the robots or of the CRS, metres
  std::string crs;                        ///< "EPSG:N", or empty: a frame of the site's own
  uint64_t epoch = 0;                     ///< 0 is empty; each commit adds one
  double created = 0;                     ///< seconds since 1970 (UTC)
  uint64_t voxels = 0, static_voxels = 0;
  uint64_t blocks = 0, tiles = 0;
  std::optional<Eigen::AlignedBox3d> bounds;  ///< of the stored blocks; nothing while the map is empty
  uint64_t sessions = 0;                      ///< merged up to this epoch
};

/// One epoch of a map's history.
struct VersionInfo {
  uint64_t epoch = 0;
  std::string session;      ///< that made it; empty for epoch 0 and for a rollback
  uint64_t base_epoch = 0;  ///< that the session was aligned to, or that the rollback brought back
  bool rollback = false;
  double time = 0;  ///< seconds since 1970 (UTC)
  uint64_t touched_tiles = 0;
  bool readable = false;  ///< what follows is known only then
  uint64_t voxels = 0, static_voxels = 0, sessions = 0;
  std::vector<std::string> tags;
};

/// What a rollback did.
struct RollbackInfo {
  uint64_t epoch = 0;                                  ///< the new one
  std::vector<std::string> rolled_back, brought_back;  ///< sessions
};

/// What changed in one block between two epochs; see BlockChange in proto/.
struct BlockChangeInfo {
  std::optional<Block> appeared, disappeared, unstable;
};

/// The objects that a comparison's changes make up, the largest first.
struct ChangedObjectsInfo {
  std::vector<ChangedObject> objects;
  bool too_many = false;  ///< more voxels differ than are grouped: there are no objects
};

/// What a check of a map found; see VerifyMapResponse.
struct VerificationInfo {
  uint64_t epochs = 0, nodes = 0, blocks = 0, voxels = 0;
  uint64_t problem_count = 0;
  std::vector<std::string> problems;  ///< the first hundred
};

/// What a collection took away, or would.
struct GarbageInfo {
  uint64_t epochs = 0, values = 0, attempts = 0, maps = 0, sessions = 0;
};

/// What a replay found; see ReplayMapResponse.
struct ReplayInfo {
  uint64_t commits = 0, blocks = 0, different = 0;
  std::string first_difference;
};

/// What a map holds at one point.
struct VoxelInfo {
  uint64_t epoch = 0;
  double hits = 0, exposures = 0;  ///< H and E, scans, after decay
  double stability = 0;            ///< R of eq. 4
  bool ground = false;
  bool is_static = false;
  bool is_new = false;                             ///< static if a second session meets it
  double first_seen = 0, last_seen = 0;            ///< starts of sessions, seconds since 1970 (UTC)
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();  ///< metres relative to the origin
  double intensity = 0;                            ///< [0, 1]
};

/// The state of a map that a stream of blocks shows.
struct MapSnapshot {
  uint64_t epoch = 0;
  double voxel_size = 0;                  ///< metres
  std::optional<Eigen::Vector3d> origin;  ///< nothing: the map has none
  std::string crs;
};

}  // namespace mapkeep
