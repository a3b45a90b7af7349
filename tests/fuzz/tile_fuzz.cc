// A tile as a robot gets it, or reads it from a file.

#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "client/mapkeep/map_tiles.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto tile = mapkeep::DecodeTile({reinterpret_cast<const char*>(data), size});
  if (!tile.ok()) return 0;
  for (const mapkeep::TileVoxel& voxel : tile->voxels) {
    if (mapkeep::PointsOf(*tile, voxel).empty()) std::abort();
  }
  return 0;
}
