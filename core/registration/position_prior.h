#pragma once

#include <Eigen/Core>

namespace mapkeep {

/// Where the sensor was at a session's first scan, as GNSS tells it: no heading, and wrong by some metres.
struct PositionPrior {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();        ///< metres, map frame
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< square metres, IsCovariance
};

/// Deviations that a place may be off its prior.
inline constexpr double kMostDeviations = 4;

/// Whether a matrix can be a covariance: finite, symmetric, every eigenvalue above 0.
bool IsCovariance(const Eigen::Matrix3d& matrix);

/// Metres about the position within which the sensor was, in any direction: kMostDeviations.
double ReachOf(const PositionPrior& prior);

/// How many deviations a place is off the prior, if it may itself be wrong by `metres`.
double DeviationsFrom(const PositionPrior& prior, const Eigen::Vector3d& place, double metres);

}  // namespace mapkeep
