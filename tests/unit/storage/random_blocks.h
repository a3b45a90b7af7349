#pragma once

#include <algorithm>
#include <cstddef>
#include <random>
#include <set>

#include "core/voxels/block.h"

namespace mapkeep {

/// A block with that many voxels of any content.
inline Block RandomBlock(BlockKey key, size_t voxels, std::mt19937_64& random) {
  std::set<uint16_t> positions;
  while (positions.size() < std::min<size_t>(voxels, 32768)) positions.insert(random() % 32768);
  Block block{key, {}};
  for (const uint16_t position : positions) {
    Voxel voxel;
    voxel.position = position;
    voxel.hits = random();
    voxel.exposures = random();
    voxel.ground = random() % 2 == 0;
    voxel.is_static = random() % 2 == 0;
    voxel.is_new = random() % 2 == 0;
    for (uint8_t& mean : voxel.mean) mean = random();
    for (uint8_t& normal : voxel.normal) normal = random();
    voxel.intensity = random();
    voxel.mask = random();
    voxel.first_seen = random();
    voxel.last_seen = random();
    block.voxels.push_back(voxel);
  }
  return block;
}

}  // namespace mapkeep
