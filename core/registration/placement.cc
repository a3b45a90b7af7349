#include "core/registration/placement.h"

#include <tbb/parallel_for.h>

#include <array>
#include <memory>
#include <utility>

namespace mapkeep {
namespace {

constexpr double kCoarseTolerance = 0.02, kFineTolerance = 0.001;  // metres: steps that end a round
constexpr int kScanIterations = 4;  // a scan begins where its window lies: within centimetres

}  // namespace

Placer::Placer(RegistrationTarget target, const AlignParameters& parameters)
    : parameters_(parameters),
      target_{std::move(target.points), std::move(target.normals)},
      tree_(target_.points),
      coverage_(target_.points) {}

Placement Placer::Place(const WindowCloud& window, const Pose& guess) const {
  return PlaceBy(std::array{Round{parameters_.coarse_correspondence, parameters_.coarse_robust_width, kCoarseTolerance},
                            Round{parameters_.fine_correspondence, parameters_.fine_robust_width, kFineTolerance}},
                 window, guess);
}

Placement Placer::Follow(const WindowCloud& window, const Pose& guess) const {
  return PlaceBy(std::array{Round{parameters_.fine_correspondence, parameters_.fine_robust_width, kFineTolerance}},
                 window, guess);
}

Placement Placer::PlaceBy(std::span<const Round> rounds, const WindowCloud& window, const Pose& guess) const {
  Placement placement{.pose = guess};
  if (target_.points.empty() || window.empty()) return placement;
  for (size_t i = 0; i < rounds.size(); ++i) {
    const bool last = i + 1 == rounds.size();
    const GicpResult result = RefineByGicp(last ? window.fine() : window.coarse(), target_, tree_, placement.pose,
                                           {.max_correspondence = rounds[i].correspondence,
                                            .robust_width = rounds[i].robust_width,
                                            .max_iterations = parameters_.max_iterations,
                                            .translation_tolerance = rounds[i].tolerance,
                                            .rotation_tolerance = rounds[i].tolerance / 10});
    placement.pose = result.pose;
    placement.centre = result.centre;
    placement.information = result.information;
    if (result.pairs == 0) break;
  }
  placement.fit = FitOf(window.sample(), target_, tree_, coverage_, placement.pose, parameters_.inlier_distance);
  placement.correction = (placement.pose.translation() - guess.translation()).norm();
  placement.rotation = AngleBetween(placement.pose, guess);
  return placement;
}

StructureFit Placer::Structure(const PlanQuery& query, const WallPlan& plan, const Pose& pose) const {
  return StructureFitOf(query, plan, target_, tree_, coverage_, pose);
}

WallPlan Placer::PlanOfTarget() const {
  const std::shared_ptr<const PlanPart> whole =
      std::make_shared<const PlanPart>(PlanOf(target_.points, target_.normals));
  return WallPlan(std::span(&whole, 1));
}

std::vector<ScanPlacement> Placer::PlaceScans(const WindowCloud& window,
                                              std::span<const std::vector<Eigen::Vector3f>* const> scans,
                                              std::span<const Pose> sensors, const Pose& placed) const {
  std::vector<ScanPlacement> placements(scans.size());
  if (target_.points.empty() || window.empty()) return placements;
  tbb::parallel_for(size_t{0}, scans.size(), [&](size_t i) {
    std::vector<Eigen::Vector3d> in_window;
    in_window.reserve(scans[i]->size());
    for (const Eigen::Vector3f& point : *scans[i]) in_window.push_back(sensors[i] * point.cast<double>());
    const SurfaceCloud source = window.SurfacesOf(in_window);
    const GicpResult result = RefineByGicp(source, target_, tree_, placed,
                                           {.max_correspondence = parameters_.fine_correspondence,
                                            .robust_width = parameters_.fine_robust_width,
                                            .max_iterations = kScanIterations});
    if (result.pairs == 0) return;
    ScanPlacement& placement = placements[i];
    placement.pose = result.pose * sensors[i];
    placement.pairs = result.pairs;
    // The centre of the points moves by t - r x arm when the sensor moves by t and turns by r.
    const Eigen::Vector3d arm = placement.pose.translation() - result.centre;
    Eigen::Matrix<double, 6, 6> carry = Eigen::Matrix<double, 6, 6>::Identity();
    carry.topRightCorner<3, 3>() << 0, -arm.z(), arm.y(), arm.z(), 0, -arm.x(), -arm.y(), arm.x(), 0;
    placement.information = carry.transpose() * result.information * carry;
  });
  return placements;
}

bool FitsMap(const Fit& fit, const AlignParameters& parameters) {
  return fit.fitness >= parameters.min_fitness && fit.inliers >= static_cast<size_t>(parameters.min_inliers) &&
         fit.observability >= parameters.min_observability && fit.precision >= parameters.min_precision &&
         fit.coverage >= parameters.min_coverage;
}

bool StructureFits(const StructureFit& fit, const AlignParameters& parameters) {
  return fit.score() >= parameters.first_structure;
}

bool FitsMapWithoutPrior(const Fit& fit, const AlignParameters& parameters) {
  return FitsMap(fit, parameters) && fit.fitness >= parameters.first_fitness &&
         fit.precision >= parameters.first_precision && fit.coverage >= parameters.first_coverage;
}

bool Agree(const Pose& predicted, const Pose& found, double travel, const AlignParameters& parameters) {
  return (predicted.translation() - found.translation()).norm() <=
             parameters.agree_distance + parameters.agree_per_metre * travel &&
         AngleBetween(predicted, found) <= parameters.agree_rotation + parameters.agree_turn * travel;
}

}  // namespace mapkeep
