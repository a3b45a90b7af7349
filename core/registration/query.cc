#include "core/registration/query.h"

#include <tbb/parallel_for.h>

#include <utility>

#include "core/registration/thinning.h"

namespace mapkeep {

absl::Status QueryBuilder::Load(const Window& window) {
  std::erase_if(thinned_, [&](const auto& scan) { return scan.first < window.first || scan.first > window.last; });
  std::vector<size_t> missing;
  for (size_t i = window.first; i <= window.last; ++i) {
    if (!thinned_.contains(i)) missing.push_back(i);
  }
  std::vector<absl::StatusOr<std::vector<Eigen::Vector3f>>> loaded(missing.size(), std::vector<Eigen::Vector3f>());
  tbb::parallel_for(size_t{0}, missing.size(), [&](size_t i) {
    const auto scan = scans_.read(missing[i]);
    if (!scan.ok()) {
      loaded[i] = scan.status();
      return;
    }
    std::vector<Eigen::Vector3d> points;
    points.reserve(scan->points.size());
    for (const Eigen::Vector3f& point : scan->points) {
      if (point.norm() <= range_) points.push_back(point.cast<double>());
    }
    for (const Eigen::Vector3d& point : ThinPoints(points, voxel_)) loaded[i]->push_back(point.cast<float>());
  });
  for (size_t i = 0; i < missing.size(); ++i) {
    if (!loaded[i].ok()) return loaded[i].status();
    thinned_.emplace(missing[i], *std::move(loaded[i]));
  }
  return absl::OkStatus();
}

absl::StatusOr<FacingPoints> QueryBuilder::QueryOf(const Window& window) {
  if (const absl::Status status = Load(window); !status.ok()) return status;
  const Pose to_first = poses_[window.first].inverse();
  FacingPoints all;
  for (size_t i = window.first; i <= window.last; ++i) {
    const Pose relative = to_first * poses_[i];
    for (const Eigen::Vector3f& point : thinned_.at(i)) {
      all.points.push_back(relative * point.cast<double>());
      all.facing.emplace_back((relative.translation() - all.points.back()).stableNormalized());
    }
  }
  return ThinPoints(all, voxel_);
}

}  // namespace mapkeep
