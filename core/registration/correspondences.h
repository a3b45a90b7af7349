#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/registration/point_tree.h"

namespace mapkeep {

/// The nearest target point of each of some points that move little by little, as in the iterations of ICP: what
/// PointTree::Nearest gives, without asking the tree again until a point has moved so far that the answer may be
/// another.
class Correspondences {
 public:
  /// `tree` is that of `target`; both outlive this. Pairs are closer than `max_distance` metres.
  Correspondences(size_t points, std::span<const Eigen::Vector3d> target, const PointTree& tree, double max_distance);

  /// The index of the target point nearest to point `i`, which is now at `position`. Different points may be asked for
  /// from several threads at once.
  std::optional<uint32_t> Match(size_t i, const Eigen::Vector3d& position);

 private:
  struct Held {
    Eigen::Vector3d at = Eigen::Vector3d::Zero();  // where the tree was asked
    double reach = -1;                             // metres about there in which its answer holds; below 0: not asked
    uint32_t index = 0;
    bool found = false;
  };

  std::span<const Eigen::Vector3d> target_;
  const PointTree& tree_;
  double max_distance_;
  std::vector<Held> held_;
};

}  // namespace mapkeep
