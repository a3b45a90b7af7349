#include "core/registration/target_map.h"

#include <algorithm>
#include <utility>

namespace mapkeep {
namespace {

bool InAny(const Eigen::Vector3d& point, std::span<const Eigen::AlignedBox3d> boxes) {
  return std::ranges::any_of(boxes, [&](const Eigen::AlignedBox3d& box) { return box.contains(point); });
}

Features Within(const Features& all, const Eigen::AlignedBox3d& box) {
  Features part{.voxel_size = all.voxel_size};
  for (size_t i = 0; i < all.points.size(); ++i) {
    if (!box.contains(all.points[i])) continue;
    part.points.push_back(all.points[i]);
    part.normals.push_back(all.normals[i]);
    part.descriptors.push_back(all.descriptors[i]);
  }
  return part;
}

}  // namespace

TargetMap MapOf(RegistrationTarget target, const MatcherParameters& parameters) {
  const auto held = std::make_shared<const RegistrationTarget>(std::move(target));
  const auto described = std::make_shared<std::vector<std::shared_ptr<const MatchTarget>>>();
  TargetMap map;
  map.points = [held](std::span<const Eigen::AlignedBox3d> boxes) -> absl::StatusOr<RegistrationTarget> {
    RegistrationTarget near{.voxel_size = held->voxel_size};
    for (size_t i = 0; i < held->points.size(); ++i) {
      if (!InAny(held->points[i], boxes)) continue;
      near.points.push_back(held->points[i]);
      near.normals.push_back(held->normals[i]);
    }
    return near;
  };
  map.match_targets = [held, described, parameters](const FacingPoints&, const std::optional<Eigen::AlignedBox3d>& box)
      -> absl::StatusOr<std::vector<std::shared_ptr<const MatchTarget>>> {
    if (described->empty()) {
      const FacingPoints points{held->points, held->normals};
      for (const double voxel : kMatchVoxels) {
        described->push_back(std::make_shared<const MatchTarget>(FeaturesOf(points, voxel, parameters)));
      }
    }
    if (!box) return *described;
    std::vector<std::shared_ptr<const MatchTarget>> near;
    for (const auto& all : *described) near.push_back(std::make_shared<const MatchTarget>(Within(all->features, *box)));
    return near;
  };
  const auto plan = std::make_shared<std::shared_ptr<const WallPlan>>();
  map.plan = [held, plan]() -> absl::StatusOr<std::shared_ptr<const WallPlan>> {
    if (!*plan) {
      const std::shared_ptr<const PlanPart> whole =
          std::make_shared<const PlanPart>(PlanOf(held->points, held->normals));
      *plan = std::make_shared<const WallPlan>(std::span(&whole, 1));
    }
    return *plan;
  };
  return map;
}

}  // namespace mapkeep
