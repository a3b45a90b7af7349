#include "core/registration/correspondences.h"

#include <cmath>

namespace mapkeep {
namespace {

constexpr double kAhead = 0.2;  // metres beyond the limit that the tree is searched, so that an answer lasts
constexpr double kRounding = 1e-9;

}  // namespace

Correspondences::Correspondences(size_t points, std::span<const Eigen::Vector3d> target, const PointTree& tree,
                                 double max_distance)
    : target_(target), tree_(tree), max_distance_(max_distance), held_(points) {}

std::optional<uint32_t> Correspondences::Match(size_t i, const Eigen::Vector3d& position) {
  Held& held = held_[i];
  if (held.reach < 0 || !((position - held.at).squaredNorm() < held.reach * held.reach)) {
    const PointTree::MatchAndNext match = tree_.NearestAndNext(position, max_distance_ + kAhead);
    const double next = std::sqrt(match.next_squared_distance);
    held = {.at = position, .found = match.nearest.has_value()};
    if (match.nearest) {
      held.index = match.nearest->index;
      // Moved by r, the nearest is at most r farther and the next at most r nearer.
      held.reach = (next - std::sqrt(match.nearest->squared_distance)) / 2 - kRounding;
    } else {
      held.reach = kAhead - kRounding;
    }
  }
  if (!held.found || !((target_[held.index] - position).squaredNorm() < max_distance_ * max_distance_)) return {};
  return held.index;
}

}  // namespace mapkeep
