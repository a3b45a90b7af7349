#pragma once

#include "core/geometry/pose.h"
#include "core/registration/fitness.h"
#include "core/registration/gicp.h"
#include "core/registration/plan_search.h"
#include "core/registration/point_tree.h"
#include "core/registration/wall_plan.h"

namespace mapkeep {

/// How well what stands upright in a window lies on what stands upright in the map. This tells a place from others
/// along the same street, where fitness and precision hardly do: most points are ground and long facades, which fit all
/// along it. A way that pieces face counts with the root of how often it occurs.
struct StructureFit {
  double walls = 0;  ///< share of the walls seen from above, where the map is known, that meet one that faces their way
  double pieces = 0;  ///< share of the pieces, where the map is known, on a surface of it that faces their way
  /// What places are compared by: neither alone is as sure.
  double score() const { return walls * pieces; }
};

/// Under `pose` (T_map_submap): walls on the plan, pieces on the points of the target. For a pose that was refined.
StructureFit StructureFitOf(const PlanQuery& query, const WallPlan& plan, const SurfaceCloud& target,
                            const PointTree& tree, const Coverage& coverage, const Pose& pose);

}  // namespace mapkeep
