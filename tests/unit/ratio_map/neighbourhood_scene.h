#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <vector>

#include "core/ratio_map/contradiction.h"
#include "core/voxels/block.h"

namespace mapkeep {

/// A map and a session voxel by voxel; 0.2 m.
class NeighbourhoodScene {
 public:
  void InMap(const VoxelIndex& at, bool ground = false, uint32_t first_seen = 0) {
    const BlockKey key = BlockKeyOf(BlockOf(at));
    Block& block = map_.try_emplace(key, Block{.key = key}).first->second;
    block.voxels.push_back({.position = PositionInBlock(at), .hits = 400, .ground = ground, .first_seen = first_seen});
    std::ranges::sort(block.voxels, {}, &Voxel::position);
  }

  void InSession(const VoxelIndex& at, uint32_t hits, uint32_t exposures) {
    std::vector<SessionVoxel>& voxels = session_[BlockKeyOf(BlockOf(at))];
    voxels.push_back({.key = VoxelKeyOf(at), .hits = hits, .exposures = exposures});
    std::ranges::sort(voxels, {}, &SessionVoxel::key);
  }

  /// Where the session had points, and removal took all of them.
  void RemovedBySession(const VoxelIndex& at) {
    InSession(at, 0, 5);
    std::ranges::find(session_[BlockKeyOf(BlockOf(at))], VoxelKeyOf(at), &SessionVoxel::key)->was_removed = true;
  }

  /// Whether a rule, such as ForgottenWithOthers, forgets the voxel of the map.
  template <typename Rule>
  bool Forgets(const Rule& rule, const VoxelIndex& at, const MergeParameters& parameters = {}) const {
    BlockNeighbourhood map{};
    SessionNeighbourhood session;
    const auto around = NeighbourhoodOf(BlockOf(at));
    for (size_t i = 0; i < around.size(); ++i) {
      const BlockKey key = BlockKeyOf(around[i]);
      if (const auto found = map_.find(key); found != map_.end()) map[i] = &found->second;
      if (const auto found = session_.find(key); found != session_.end()) session[i] = found->second;
    }
    return std::ranges::binary_search(rule(map, session, 0.2, parameters), PositionInBlock(at));
  }

 private:
  std::map<BlockKey, Block> map_;
  std::map<BlockKey, std::vector<SessionVoxel>> session_;
};

}  // namespace mapkeep
