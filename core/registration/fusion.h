#pragma once

#include <span>
#include <vector>

#include "core/geometry/pose.h"
#include "core/registration/windows.h"

namespace mapkeep {

/// A trusted window: T_abs^u, which takes the session frame to the map frame, and its fitness f_u.
struct TrustedWindow {
  Window window;
  Pose correction = Pose::Identity();
  double fitness = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of its points, map frame
  /// What its surfaces fix of its motion (Placement::information).
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Identity();
};

/// The weighted mean of poses: of translations, and of rotations as unit quaternions (Markley et al., 2007). Weights
/// must be positive somewhere; lists of equal length, not empty.
Pose BlendPoses(std::span<const Pose> poses, std::span<const double> weights);

/// Scan poses in the map frame from those in the session frame (paper, eq. 2). A scan that trusted windows cover gets
/// the mean of what they say, weighted with their fitness and with how far the scan is from the window's ends, so that
/// the trajectory has no steps where windows begin. Any other scan is carried by its nearest covered neighbours before
/// and after, weighted with the inverse of the distance travelled to them; beyond the first and last, by that one
/// alone. `trusted` must not be empty.
std::vector<Pose> FusePoses(std::span<const Pose> poses, std::span<const TrustedWindow> trusted);

}  // namespace mapkeep
