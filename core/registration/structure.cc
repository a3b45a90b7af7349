#include "core/registration/structure.h"

#include <algorithm>
#include <cmath>

namespace mapkeep {
namespace {

constexpr double kReach = 0.5;        // metres: a piece meets a point of the map nearer than this,
constexpr double kOffSurface = 0.15;  // that far off its plane at most,
constexpr double kSameWay = 0.7;      // whose normal makes at most 45 degrees with its own

double PiecesMet(const PlanQuery& query, const SurfaceCloud& target, const PointTree& tree, const Coverage& coverage,
                 const Pose& pose) {
  size_t known = 0, met = 0;
  for (const PlanQuery::Piece& piece : query.pieces) {
    const Eigen::Vector3d point = pose * piece.point.cast<double>();
    const auto match = tree.Nearest(point, kReach);
    if (!match) {
      known += coverage.Holds(point) ? 1 : 0;
      continue;
    }
    ++known;
    const Eigen::Vector3d& normal = target.normals[match->index];
    if (normal.dot(pose.linear() * piece.normal.cast<double>()) < kSameWay) continue;
    if (std::abs(normal.dot(point - target.points[match->index])) <= kOffSurface) ++met;
  }
  return static_cast<double>(met) / static_cast<double>(std::max<size_t>(known, 1));
}

}  // namespace

StructureFit StructureFitOf(const PlanQuery& query, const WallPlan& plan, const SurfaceCloud& target,
                            const PointTree& tree, const Coverage& coverage, const Pose& pose) {
  return {.walls = WallsMet(query, plan, pose), .pieces = PiecesMet(query, target, tree, coverage, pose)};
}

}  // namespace mapkeep
