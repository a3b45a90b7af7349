#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Geometry>
#include <array>
#include <span>

namespace mapkeep {

/// Rigid motion T_parent_child: p_parent = pose * p_child. Metres, float64.
using Pose = Eigen::Isometry3d;

/// The 3x4 matrix [R t], row by row: how pose files and the wire carry a pose.
using PoseRows = std::array<double, 12>;

/// The pose of a row-major 3x4 matrix. INVALID_ARGUMENT if an entry is not finite, or if the left 3x3 is not a
/// rotation: R^T R differs from the identity by more than 1e-3 in an entry, or it mirrors. The rotation is made exact.
absl::StatusOr<Pose> PoseFromRows(std::span<const double, 12> rows);

PoseRows RowsOf(const Pose& pose);

/// Angle of the rotation that leads from a to b, in [0, pi] radians.
double AngleBetween(const Pose& a, const Pose& b);

}  // namespace mapkeep
