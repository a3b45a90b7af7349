#include "core/registration/localisation.h"

#include <Eigen/LU>
#include <utility>

#include "core/registration/aligner.h"
#include "core/registration/place_search.h"
#include "core/registration/placement.h"
#include "core/registration/query.h"

namespace mapkeep {
namespace {

constexpr double kPairMetres = 0.05;    // a pair's deviation from its surface
constexpr double kPairsTogether = 100;  // pairs on one surface do not err on their own
constexpr double kTargetMargin = 3;     // metres about the scans from which the map is read

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// The covariance of the sensor's position and rotation from the information about the centre of its points.
Matrix6 CovarianceAt(const Eigen::Vector3d& position, const Placement& placement) {
  const Matrix6 about_centre = kPairMetres * kPairMetres * kPairsTogether * placement.information.inverse();
  const Eigen::Vector3d arm = position - placement.centre;
  Matrix6 carry = Matrix6::Identity();  // the position moves by t + r x arm
  carry.topRightCorner<3, 3>() << 0, arm.z(), -arm.y(), -arm.z(), 0, arm.x(), arm.y(), -arm.x(), 0;
  return carry * about_centre * carry.transpose();
}

}  // namespace

absl::StatusOr<Localisation> Localise(const ScanSource& scans, std::span<const Pose> poses, const TargetMap& map,
                                      const std::optional<Pose>& prior, const AlignParameters& parameters) {
  const auto alignment = AlignSession(scans, poses, map, prior, parameters);
  if (!alignment.ok()) return alignment.status();
  Localisation localisation{.found = alignment->accepted, .reason = alignment->reason};
  if (!localisation.found) return localisation;
  QueryBuilder queries(scans, poses, parameters.source_voxel, parameters.query_range);
  const auto query = queries.QueryOf({0, poses.size() - 1});
  if (!query.ok()) return query.status();
  const Eigen::AlignedBox3d box = BoxAbout(query->points, alignment->poses.front(), kTargetMargin);
  auto target = map.points(std::span(&box, 1));
  if (!target.ok()) return target.status();
  const Placement placement = Placer(*std::move(target), parameters)
                                  .Place(WindowCloud(query->points, parameters.source_voxel), alignment->poses.front());
  if (!FitsMap(placement.fit, parameters)) return Localisation{.reason = "the scans together do not fit the map"};
  localisation.pose = placement.pose * (poses.front().inverse() * poses.back());
  localisation.fitness = placement.fit.fitness;
  localisation.precision = placement.fit.precision;
  localisation.inliers = placement.fit.inliers;
  localisation.covariance = CovarianceAt(localisation.pose.translation(), placement);
  return localisation;
}

}  // namespace mapkeep
