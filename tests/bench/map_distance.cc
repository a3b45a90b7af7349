#include "tests/bench/map_distance.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/registration/point_tree.h"

namespace mapkeep {
namespace {

constexpr double kInlier = 0.5;  // metres

// Distances to the nearest point of the other map, of those within kInlier.
std::vector<double> Distances(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to) {
  const PointTree tree(to);
  std::vector<double> squared(from.size(), -1);
  tbb::parallel_for(size_t{0}, from.size(), [&](size_t i) {
    if (const auto match = tree.Nearest(from[i], kInlier)) squared[i] = match->squared_distance;
  });
  std::erase_if(squared, [](double value) { return value < 0; });
  for (double& value : squared) value = std::sqrt(value);
  return squared;
}

double MeanOf(std::span<const double> values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

}  // namespace

MapDistance DistanceBetween(std::span<const Eigen::Vector3d> first, std::span<const Eigen::Vector3d> second) {
  if (first.empty() || second.empty()) return {};
  const std::vector<double> forth = Distances(second, first), back = Distances(first, second);
  double squares = 0;
  for (const double distance : forth) squares += distance * distance;
  return {.inliers = forth.size(),
          .share = static_cast<double>(forth.size()) / static_cast<double>(second.size()),
          .rmse = std::sqrt(squares / static_cast<double>(std::max<size_t>(forth.size(), 1))),
          .chamfer = (MeanOf(forth) + MeanOf(back)) / 2};
}

}  // namespace mapkeep
