#include "core/registration/aligner.h"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "core/registration/fitness.h"
#include "core/registration/fusion.h"
#include "core/registration/gicp.h"
#include "core/registration/point_tree.h"
#include "core/registration/query.h"
#include "core/registration/surface_normals.h"
#include "core/registration/thinning.h"
#include "core/registration/windows.h"

namespace mapkeep {
namespace {

constexpr double kCoarseThinning = 3;  // the first round takes a point of this many source voxels
constexpr double kFineThinning = 2;

absl::Status CheckInput(const ScanSource& scans, std::span<const Pose> poses, const RegistrationTarget& target,
                        const AlignParameters& parameters) {
  for (const auto& [name, value] : {std::pair("source_voxel", parameters.source_voxel),
                                    std::pair("coarse_correspondence", parameters.coarse_correspondence),
                                    std::pair("fine_correspondence", parameters.fine_correspondence),
                                    std::pair("inlier_distance", parameters.inlier_distance),
                                    std::pair("coarse_robust_width", parameters.coarse_robust_width),
                                    std::pair("fine_robust_width", parameters.fine_robust_width)}) {
    if (!(value > 0))
      return absl::InvalidArgumentError(absl::StrFormat("%s is %g m, expected more than 0", name, value));
  }
  if (scans.count != poses.size()) {
    return absl::InvalidArgumentError(absl::StrFormat("%d scans but %d poses", scans.count, poses.size()));
  }
  if (target.points.size() != target.normals.size()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("the target has %d points but %d normals", target.points.size(), target.normals.size()));
  }
  return absl::OkStatus();
}

/// The target with its tree, in whose frame windows are placed.
class Placer {
 public:
  Placer(const RegistrationTarget& target, const AlignParameters& parameters)
      : parameters_(parameters), target_{target.points, target.normals}, tree_(target_.points) {}

  struct Placement {
    Pose pose = Pose::Identity();  // T_map_window
    Fit fit;
  };

  /// Coarse, then fine GICP from the guess, and the fit where that ends. `query` in the window's frame.
  Placement Place(std::span<const Eigen::Vector3d> query, const Pose& guess) const {
    Placement placement{.pose = guess};
    const PointTree query_tree(query);
    const auto round = [&](double thinning, double correspondence, double robust_width) {
      const SurfaceCloud source = Surfaces(ThinPoints(query, thinning * parameters_.source_voxel), query, query_tree);
      const GicpResult result = RefineByGicp(source, target_, tree_, placement.pose,
                                             {.max_correspondence = correspondence,
                                              .robust_width = robust_width,
                                              .max_iterations = parameters_.max_iterations});
      placement.pose = result.pose;
      return result.pairs > 0;
    };
    if (!round(kCoarseThinning, parameters_.coarse_correspondence, parameters_.coarse_robust_width)) return placement;
    round(kFineThinning, parameters_.fine_correspondence, parameters_.fine_robust_width);
    placement.fit = FitOf(query, target_, tree_, placement.pose, parameters_.inlier_distance);
    return placement;
  }

 private:
  static SurfaceCloud Surfaces(std::vector<Eigen::Vector3d> at, std::span<const Eigen::Vector3d> points,
                               const PointTree& tree) {
    SurfaceCloud cloud{.points = std::move(at)};
    cloud.normals.reserve(cloud.points.size());
    for (const SurfaceNormal& surface : SurfaceNormalsAt(cloud.points, points, tree)) {
      cloud.normals.push_back(surface.normal);
    }
    return cloud;
  }

  AlignParameters parameters_;
  SurfaceCloud target_;
  PointTree tree_;
};

bool IsTrusted(const WindowResult& window, const AlignParameters& parameters) {
  return window.fitness >= parameters.min_fitness && window.inliers >= static_cast<uint32_t>(parameters.min_inliers) &&
         window.correction <= parameters.max_correction && window.rotation <= parameters.max_rotation &&
         window.observability >= parameters.min_observability;
}

/// What is known of one window while the session is tracked.
struct TrackedWindow {
  Window window;
  WindowResult result;
  Pose correction = Pose::Identity();  // T_abs^u, of a trusted window
};

/// Places one window from the prior correction.
absl::Status PlaceWindow(const Placer& placer, QueryBuilder& queries, std::span<const Pose> poses, const Pose& prior,
                         const AlignParameters& parameters, TrackedWindow& tracked) {
  const auto query = queries.QueryOf(tracked.window);
  if (!query.ok()) return query.status();
  const Pose& first = poses[tracked.window.first];
  const Pose guess = prior * first;
  const Placer::Placement placement = placer.Place(*query, guess);
  WindowResult& result = tracked.result;
  result = {.first_scan = static_cast<uint32_t>(tracked.window.first),
            .last_scan = static_cast<uint32_t>(tracked.window.last),
            .fitness = placement.fit.fitness,
            .inliers = static_cast<uint32_t>(placement.fit.inliers),
            .correction = (placement.pose.translation() - guess.translation()).norm(),
            .rotation = AngleBetween(placement.pose, guess),
            .observability = placement.fit.observability};
  result.trusted = IsTrusted(result, parameters);
  tracked.correction = placement.pose * first.inverse();
  return absl::OkStatus();
}

std::string Refusal(std::span<const TrackedWindow> windows, const AlignParameters& parameters) {
  const auto best = std::ranges::max_element(windows, {}, [](const TrackedWindow& w) { return w.result.fitness; });
  const WindowResult& result = best->result;
  return absl::StrFormat(
      "no window of %d fits the map; the best, scans %d to %d, has fitness %.2f (at least %.2f is needed), %d inliers "
      "(%d), moved %.2f m (at most %.2f) and %.3f rad (%.3f), observability %.3f (at least %.3f)",
      windows.size(), result.first_scan, result.last_scan, result.fitness, parameters.min_fitness, result.inliers,
      parameters.min_inliers, result.correction, parameters.max_correction, result.rotation, parameters.max_rotation,
      result.observability, parameters.min_observability);
}

}  // namespace

absl::StatusOr<Alignment> AlignSession(const ScanSource& scans, std::span<const Pose> poses,
                                       const RegistrationTarget& target, const AlignParameters& parameters,
                                       const Progress& progress) {
  if (const absl::Status status = CheckInput(scans, poses, target, parameters); !status.ok()) return status;
  Alignment alignment;
  if (poses.empty() || target.points.empty()) {
    alignment.reason = poses.empty() ? "the session has no scans" : "the map has nothing static near the session";
    return alignment;
  }
  const Placer placer(target, parameters);
  QueryBuilder queries(scans, poses, parameters.source_voxel);
  std::vector<TrackedWindow> windows;
  for (const Window& window : WindowsOf(poses, parameters)) windows.push_back({.window = window});

  // Forward: each window starts from the last one that was trusted.
  Pose prior = Pose::Identity();
  std::optional<size_t> first_trusted;
  for (size_t u = 0; u < windows.size(); ++u) {
    const absl::Status status = PlaceWindow(placer, queries, poses, prior, parameters, windows[u]);
    if (!status.ok()) return status;
    if (windows[u].result.trusted) {
      prior = windows[u].correction;
      if (!first_trusted) first_trusted = u;
    }
    const double done = static_cast<double>(u + 1) / static_cast<double>(windows.size());
    if (progress && !progress(done)) return absl::CancelledError("stopped while aligning the session");
  }
  // And back: what came before the first trusted window is tried once more from there.
  for (size_t u = first_trusted.value_or(0); u-- > 0;) {
    const absl::Status status = PlaceWindow(placer, queries, poses, windows[u + 1].correction, parameters, windows[u]);
    if (!status.ok()) return status;
    if (!windows[u].result.trusted) windows[u].correction = windows[u + 1].correction;
    if (progress && !progress(1)) return absl::CancelledError("stopped while aligning the session");
  }

  std::vector<TrustedWindow> trusted;
  for (const TrackedWindow& window : windows) {
    alignment.windows.push_back(window.result);
    if (window.result.trusted) trusted.push_back({window.window, window.correction, window.result.fitness});
  }
  if (trusted.empty()) {
    alignment.reason = Refusal(windows, parameters);
    return alignment;
  }
  alignment.accepted = true;
  alignment.poses = FusePoses(poses, trusted);
  return alignment;
}

}  // namespace mapkeep
