#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/registration/match_cloud.h"

namespace mapkeep {

/// One mean point a voxel of `edge` metres, in the order in which the voxels first occur. Points that are not finite,
/// or lie 2^20 voxels or more from the origin, are left out.
std::vector<Eigen::Vector3d> ThinPoints(std::span<const Eigen::Vector3d> points, double edge);

/// The same of points that face somewhere: the facings of a voxel are averaged as well.
FacingPoints ThinPoints(const FacingPoints& input, double edge);

}  // namespace mapkeep
