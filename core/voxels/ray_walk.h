#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>

#include "core/voxels/voxel_index.h"

namespace mapkeep {

/// The voxels along a segment in order, by Amanatides and Woo ("A Fast Voxel Traversal Algorithm", 1987). Starts in the
/// voxel of `from` and reaches the voxel of `to` after exactly as many steps as their indices differ, one axis a step.
/// Where the segment passes through an edge or a corner the lower axis is stepped first. The time of each crossing is
/// computed from the boundary's index, never summed up, so that skipping ahead visits the same voxels as walking.
class RayWalk {
 public:
  /// `from` and `to` in voxel edges (metres / voxel size), with their voxels.
  RayWalk(const Eigen::Vector3d& from, const VoxelIndex& first, const Eigen::Vector3d& to, const VoxelIndex& last)
      : at_{first.x, first.y, first.z}, last_{last.x, last.y, last.z} {
    for (int axis = 0; axis < 3; ++axis) {
      step_[axis] = last_[axis] > at_[axis] ? 1 : -1;
      from_[axis] = from[axis];
      inverse_[axis] = 1 / (to[axis] - from[axis]);
      Recompute(axis);
    }
  }

  const std::array<int32_t, 3>& at() const { return at_; }
  bool done() const { return at_ == last_; }

  /// When the segment enters the current voxel (0 for the first) and when it leaves it: shares of its length.
  double entry_time() const { return entry_; }
  double exit_time() const { return next_[NextAxis()]; }

  /// To the next voxel; not when done.
  void Step() {
    const int axis = NextAxis();
    entry_ = next_[axis];
    at_[axis] += step_[axis];
    Recompute(axis);
  }

  /// To the first voxel outside the aligned cube of 2^bits voxels that holds the current one, or to the last voxel if
  /// that lies inside it.
  void LeaveCube(int bits) {
    std::array<int32_t, 3> boundary;  // the far face of the cube, as a boundary index
    std::array<double, 3> time;
    for (int axis = 0; axis < 3; ++axis) {
      const int32_t cube = at_[axis] >> bits;
      if (cube == last_[axis] >> bits) {
        time[axis] = std::numeric_limits<double>::infinity();
        boundary[axis] = 0;
      } else {
        boundary[axis] = (cube + (step_[axis] > 0 ? 1 : 0)) * (1 << bits);
        time[axis] = (boundary[axis] - from_[axis]) * inverse_[axis];
      }
    }
    const int exit = time[1] < time[0] ? (time[2] < time[1] ? 2 : 1) : (time[2] < time[0] ? 2 : 0);
    if (time[exit] == std::numeric_limits<double>::infinity()) {
      while (!done()) Step();
      return;
    }
    for (int axis = 0; axis < 3; ++axis) {
      if (axis == exit) continue;
      // Every crossing of this axis that comes before the exit (or with it, on a lower axis).
      while (at_[axis] != last_[axis] && (next_[axis] < time[exit] || (next_[axis] == time[exit] && axis < exit))) {
        at_[axis] += step_[axis];
        Recompute(axis);
      }
    }
    entry_ = time[exit];
    at_[exit] = step_[exit] > 0 ? boundary[exit] : boundary[exit] - 1;
    Recompute(exit);
  }

 private:
  int NextAxis() const { return next_[1] < next_[0] ? (next_[2] < next_[1] ? 2 : 1) : (next_[2] < next_[0] ? 2 : 0); }

  // The time at which the walk leaves the current voxel along the axis: infinite once it has come as far as it goes.
  void Recompute(int axis) {
    next_[axis] = at_[axis] == last_[axis] ? std::numeric_limits<double>::infinity()
                                           : (at_[axis] + (step_[axis] > 0 ? 1 : 0) - from_[axis]) * inverse_[axis];
  }

  std::array<int32_t, 3> at_, last_, step_;
  std::array<double, 3> from_, inverse_, next_;
  double entry_ = 0;
};

}  // namespace mapkeep
