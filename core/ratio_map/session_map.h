#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/dor/remover.h"
#include "core/geometry/pose.h"
#include "core/geometry/progress.h"
#include "core/geometry/scan.h"
#include "core/voxels/evidence.h"
#include "core/voxels/voxel_index.h"

namespace mapkeep {

/// One voxel of a session's ratio map V_S (paper section 3.4). With hits == 0 only the exposures mean something.
struct SessionVoxel {
  VoxelKey key{};
  uint32_t hits = 0;         ///< H_S: scans with a kept point in the voxel
  uint32_t exposures = 0;    ///< E_S: scans that looked through it, also where all its points were removed
  bool was_removed = false;  ///< had points, and removal took all of them
  bool ground = false;
  std::array<uint8_t, 3> mean{};    ///< of the kept points, as Voxel::mean
  std::array<uint8_t, 2> normal{};  ///< as Voxel::normal, oriented towards the sensor positions
  uint8_t intensity = 0;
  uint64_t mask = 0;  ///< sub-voxels with a kept point, as Voxel::mask

  bool operator==(const SessionVoxel&) const = default;
};

/// V_S: what one session says about the map's voxels. Sorted by key, none twice.
struct SessionMap {
  double voxel_size = 0;
  uint32_t start_minutes = 0;  ///< start of the session, minutes since 2000-01-01 UTC
  double n_max = 0;            ///< N_max of eq. 8: by default the 99th percentile of N_S = H_S + E_S over hit voxels
  std::vector<SessionVoxel> voxels;
};

struct SessionMapParameters {
  double n_max_percentile = 99;  ///< of N_S over the session's hit voxels; 100 is the paper's maximum (N_max, eq. 8)
  double normal_radius_voxels = 1.5;  ///< neighbourhood of a voxel's normal, in voxel edges between centroids
};

/// Labels of the points of one scan, as Removal::Label gives them.
using Labeller = std::function<std::vector<PointLabel>(size_t index, const Scan& scan)>;

/// The session's ratio map from its aligned scans, the labels of their points, and the evidence that removal counted
/// (at the map's voxel size, over the session's voxels and the map's at the base epoch). Independent of the number of
/// threads. Errors of the source are passed on; CANCELLED when `progress` says stop.
absl::StatusOr<SessionMap> BuildSessionMap(const ScanSource& scans, std::span<const Pose> poses, const Labeller& label,
                                           const Evidence& evidence, uint32_t start_minutes,
                                           const SessionMapParameters& parameters, const Progress& progress = {});

}  // namespace mapkeep
