#include "core/geometry/pose.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

namespace mapkeep {

absl::StatusOr<Pose> PoseFromRows(std::span<const double, 12> rows) {
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!std::isfinite(rows[i])) {
      return absl::InvalidArgumentError(absl::StrFormat("pose value %d of 12 is not finite", i + 1));
    }
  }
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(rows.data());
  const Eigen::Matrix3d rotation = matrix.leftCols<3>();
  const double error = (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error <= 1e-3)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("the left 3x3 of the pose is not a rotation: R^T R is off the identity by %.3g", error));
  }
  if (rotation.determinant() < 0) {
    return absl::InvalidArgumentError("the left 3x3 of the pose is a reflection, not a rotation");
  }
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::Quaterniond(rotation).normalized().toRotationMatrix();
  pose.translation() = matrix.col(3);
  return pose;
}

PoseRows RowsOf(const Pose& pose) {
  PoseRows rows;
  Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(rows.data()) = pose.matrix().topRows<3>();
  return rows;
}

double AngleBetween(const Pose& a, const Pose& b) {
  return Eigen::Quaterniond(a.linear()).angularDistance(Eigen::Quaterniond(b.linear()));
}

}  // namespace mapkeep
