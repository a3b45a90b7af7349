#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/registration/gicp.h"
#include "core/registration/thinning.h"

namespace mapkeep {

/// A window's submap made ready to be placed: its surfaces are looked for once, however often and wherever it is tried.
/// All in the window's frame.
class WindowCloud {
 public:
  /// `query` is a submap thinned to `source_voxel` metres. Parallel on the calling oneTBB arena, with the same result
  /// on any number of threads.
  WindowCloud(std::span<const Eigen::Vector3d> query, double source_voxel);

  bool empty() const { return fine_.points.empty(); }
  /// Points spread over the submap, two source voxels apart at least, with its normals there: for a last round of
  /// refinement,
  const SurfaceCloud& fine() const { return fine_; }
  /// and half as many for a first one.
  const SurfaceCloud& coarse() const { return coarse_; }
  /// Points of the submap, spread over all of it, by which a fit is judged.
  std::span<const Eigen::Vector3d> sample() const { return sample_; }

  /// Mean points of a scan of the window, two source voxels apart and spread over it, with the normals of the window's
  /// points there: a scan alone is too sparse for normals of its own.
  SurfaceCloud SurfacesOf(std::span<const Eigen::Vector3d> scan) const;

 private:
  VoxelNumbers numbers_;                  // voxels of two source voxels
  std::vector<Eigen::Vector3d> normals_;  // at their numbers
  SurfaceCloud fine_, coarse_;
  std::vector<Eigen::Vector3d> sample_;
};

}  // namespace mapkeep
