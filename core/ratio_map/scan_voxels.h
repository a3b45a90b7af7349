#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/dor/remover.h"
#include "core/geometry/pose.h"
#include "core/geometry/scan.h"
#include "core/voxels/voxel_index.h"

namespace mapkeep {

inline constexpr uint32_t kFractionScale =
    4096;  ///< fixed point of fractions in [0, 1): of a voxel's edge, of intensity

/// What the kept points of one scan say about one voxel.
struct ScanVoxel {
  VoxelKey key{};
  bool ground = false;                      ///< most of the kept points are ground
  std::array<uint16_t, 3> mean{};           ///< of the kept points, 1/kFractionScale of the edge an axis
  uint16_t intensity = 0;                   ///< likewise, of 1.0
  std::array<int16_t, 3> towards_sensor{};  ///< from the voxel's centre, length kFractionScale
  uint64_t mask = 0;                        ///< as Voxel::mask
};

/// The voxels of the kept points of a scan, sorted by key, none twice. `labels` holds one label a point. OUT_OF_RANGE
/// naming the point for one beyond the 21-bit range.
absl::StatusOr<std::vector<ScanVoxel>> VoxelsOfScan(const Scan& scan, const Pose& pose,
                                                    std::span<const PointLabel> labels, double voxel_size);

}  // namespace mapkeep
