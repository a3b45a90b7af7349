#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/changes/change_class.h"
#include "core/tiling/tile_point.h"

namespace mapkeep {

// A tile as binary glTF 2.0 (GLB): one mesh of points in the frame of glTF, y up, so that a viewer of 3D Tiles, which
// turns y to z, shows the map's own frame.
//
//   POSITION    3 x uint16, KHR_mesh_quantization: whole sub-voxels in the mesh's own frame, which is z up; the node's
//               translation, rotation and scale make metres of them. Exact up to 65,536 sub-voxels (3.2 km at voxels of
//               0.2 m) across; beyond that in steps of 2, 4, ... sub-voxels.
//   NORMAL      3 x int8 normalised; (0, 0, 1) where the map knows none
//   COLOR_0     4 x uint8 normalised: ColourAt the height
//   _STABILITY  uint8: R of eq. 4, 255 is 1
//   _AGE        uint16: days from the first session that hit the voxel to `newest_day`
//   _GROUND     uint8: 0 or 1
//   _INTENSITY  uint8: 255 is 1
//   _CLASS      uint8, only of changes: 0 appeared, 1 disappeared, 2 unstable

struct PointTileOptions {
  double voxel_size = 0.2;                 ///< metres
  uint16_t newest_day = 0;                 ///< that ages count back from, days since 2000-01-01 UTC
  std::span<const ChangeClass> classes{};  ///< empty, or one a point; then also the colours follow it
};

/// The bytes of the file. No points give a valid file with an empty scene.
std::string EncodePointTile(std::span<const TilePoint> points, const PointTileOptions& options);

}  // namespace mapkeep
