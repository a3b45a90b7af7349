#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <span>
#include <vector>

#include "core/dor/parameters.h"
#include "core/dor/scan_loop.h"
#include "core/geometry/pose.h"
#include "core/geometry/progress.h"
#include "core/geometry/scan.h"
#include "core/voxels/evidence.h"
#include "core/voxels/voxel_grid.h"

namespace mapkeep {

/// The voxels that a session hit, and the watched ones, numbered.
struct SessionVoxels {
  VoxelGrid grid;
  std::vector<uint64_t>
      masks;  ///< by id: 4x4x4 sub-voxels with a point of any scan, bit x + 4 y + 16 z; 0 if never hit
  std::vector<uint32_t> order;  ///< the scans in the order of their times
  bool ordered = false;         ///< whether their times are known; if not, `order` is as they were given
};

/// H and E of eq. 4 by voxel id: statistics, never points.
struct VoxelCounts {
  std::vector<uint32_t> hits;       ///< scans with a point in the voxel
  std::vector<uint32_t> exposures;  ///< scans that looked through it and had no point in it
  std::vector<uint32_t> confirmed;  ///< of those, the ones to which all around it was clear, too
  /// Scans to which all around the voxel was clear, of two rows of rays at least, one of which passed the voxel:
  /// through what of it the session hit, or, where that is little, anywhere.
  std::vector<uint32_t> clear;

  // What the order of the scans adds. Scans are counted from 0 in the order of time.
  bool ordered = false;                   ///< false: the times are not known, and what follows means nothing
  std::vector<uint32_t> early;            ///< exposures before the first hit
  std::vector<uint32_t> late;             ///< exposures after the last hit
  std::vector<uint32_t> first_hit;        ///< the scan of the first hit
  std::vector<uint32_t> last_hit;         ///< and of the last
  std::vector<uint32_t> free_until;       ///< where early > 0: the last of those exposures
  std::vector<uint32_t> free_from;        ///< where late > 0: the first of those
  std::vector<uint32_t> confirmed_early;  ///< confirmed exposures before the first hit
  std::vector<uint32_t> confirmed_late;   ///< and after the last
  std::vector<uint32_t> returns;          ///< hits after which nothing but exposures had come since the hit before
};

/// The first pass. Errors as RemoveDynamicObjects.
absl::StatusOr<SessionVoxels> CollectVoxels(const ScanSource& scans, std::span<const Pose> poses, double voxel_size,
                                            std::span<const VoxelKey> watched, const ProgressPart& progress);

/// The second pass, over the same scans. A voxel is exposed in a scan if a ray passes through it before the voxel of
/// its return and no point of the scan lies in it; `parameters` say what else it takes. Linear in the rays' lengths;
/// independent of the number of threads.
absl::StatusOr<VoxelCounts> CountVoxels(const ScanSource& scans, std::span<const Pose> poses, double voxel_size,
                                        const SessionVoxels& voxels, const ExposureParameters& parameters,
                                        const ProgressPart& progress);

/// The counts as columns sorted by voxel key.
Evidence EvidenceOf(const VoxelGrid& grid, const VoxelCounts& counts, double voxel_size);

/// H and E of the scans' voxels and of the watched ones (sorted; may be empty): exactly what RemoveDynamicObjects
/// counts, without the verdict. Arguments and errors as there.
absl::StatusOr<Evidence> CountEvidence(const ScanSource& scans, std::span<const Pose> poses, double voxel_size,
                                       std::span<const VoxelKey> watched, const Progress& progress = {},
                                       const ExposureParameters& parameters = {});

}  // namespace mapkeep
