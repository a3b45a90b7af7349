#include "core/dor/clusters.h"

#include <absl/container/flat_hash_map.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace mapkeep {
namespace {

constexpr int kAxisBits = 21;

// Cells may share a key 2^21 cells apart; distances are checked, so that costs time and never a wrong neighbour.
uint64_t CellKey(int64_t x, int64_t y, int64_t z) {
  constexpr uint64_t kMask = (uint64_t{1} << kAxisBits) - 1;
  return (static_cast<uint64_t>(x) & kMask) | (static_cast<uint64_t>(y) & kMask) << kAxisBits |
         (static_cast<uint64_t>(z) & kMask) << (2 * kAxisBits);
}

// Points sorted into cubes of edge epsilon, so that neighbours lie in the 27 cubes around.
class NeighbourGrid {
 public:
  NeighbourGrid(std::span<const Eigen::Vector3d> points, double epsilon) : points_(points), epsilon_(epsilon) {
    std::vector<std::pair<uint64_t, uint32_t>> keyed(points.size());
    for (uint32_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d cell = CellOf(points[i]);
      keyed[i] = {
          CellKey(static_cast<int64_t>(cell.x()), static_cast<int64_t>(cell.y()), static_cast<int64_t>(cell.z())), i};
    }
    std::ranges::sort(keyed);
    order_.reserve(keyed.size());
    for (uint32_t begin = 0; begin < keyed.size();) {
      uint32_t end = begin;
      for (; end < keyed.size() && keyed[end].first == keyed[begin].first; ++end) order_.push_back(keyed[end].second);
      cells_.emplace(keyed[begin].first, std::pair(begin, end));
      begin = end;
    }
  }

  // Calls visit(index, squared distance) for every point within epsilon of point `of`, itself included.
  template <typename Visit>
  void ForEachNeighbour(uint32_t of, const Visit& visit) const {
    AnyNeighbour(of, [&](uint32_t index, double squared) {
      visit(index, squared);
      return false;
    });
  }

  // The same, until a visit gives true; whether one did.
  template <typename Visit>
  bool AnyNeighbour(uint32_t of, const Visit& visit) const {
    const Eigen::Vector3d own = CellOf(points_[of]);
    const auto x = static_cast<int64_t>(own.x()), y = static_cast<int64_t>(own.y()), z = static_cast<int64_t>(own.z());
    for (int i = 0; i < 27; ++i) {
      const auto found = cells_.find(CellKey(x + (i % 3 - 1), y + (i / 3 % 3 - 1), z + (i / 9 - 1)));
      if (found == cells_.end()) continue;
      for (uint32_t at = found->second.first; at < found->second.second; ++at) {
        const double squared = (points_[order_[at]] - points_[of]).squaredNorm();
        if (squared <= epsilon_ * epsilon_ && visit(order_[at], squared)) return true;
      }
    }
    return false;
  }

  // Calls visit(index) for points within epsilon of point `of`: over all points, each pair once.
  template <typename Visit>
  void ForEachPartner(uint32_t of, const Visit& visit) const {
    const Eigen::Vector3d own = CellOf(points_[of]);
    const auto x = static_cast<int64_t>(own.x()), y = static_cast<int64_t>(own.y()), z = static_cast<int64_t>(own.z());
    for (int i = kOwnCell; i < 27; ++i) {
      const auto found = cells_.find(CellKey(x + (i % 3 - 1), y + (i / 3 % 3 - 1), z + (i / 9 - 1)));
      if (found == cells_.end()) continue;
      for (uint32_t at = found->second.first; at < found->second.second; ++at) {
        const uint32_t other = order_[at];
        if (i == kOwnCell && other >= of) continue;
        if ((points_[other] - points_[of]).squaredNorm() <= epsilon_ * epsilon_) visit(other);
      }
    }
  }

 private:
  static constexpr int kOwnCell = 13;  // of the 27, the cells after which are opposite to those before

  Eigen::Vector3d CellOf(const Eigen::Vector3d& point) const { return (point / epsilon_).array().floor(); }

  std::span<const Eigen::Vector3d> points_;
  double epsilon_;
  std::vector<uint32_t> order_;
  absl::flat_hash_map<uint64_t, std::pair<uint32_t, uint32_t>> cells_;
};

// The lowest index of each set is its root, so that the result does not depend on the order of the unions.
class DisjointSets {
 public:
  explicit DisjointSets(size_t count) : parents_(count) { std::iota(parents_.begin(), parents_.end(), 0U); }

  uint32_t Root(uint32_t of) {
    while (parents_[of] != of) of = parents_[of] = parents_[parents_[of]];
    return of;
  }

  void Unite(uint32_t a, uint32_t b) {
    a = Root(a);
    b = Root(b);
    parents_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<uint32_t> parents_;
};

}  // namespace

Clusters ClusterPoints(std::span<const Eigen::Vector3d> points, double epsilon, int min_neighbours) {
  const NeighbourGrid grid(points, epsilon);
  const auto count = static_cast<uint32_t>(points.size());
  std::vector<char> core(count);
  tbb::parallel_for(tbb::blocked_range<uint32_t>(0, count, 256), [&](const auto& range) {
    for (uint32_t i = range.begin(); i != range.end(); ++i) {
      int neighbours = 0;
      core[i] = grid.AnyNeighbour(i, [&](uint32_t, double) { return ++neighbours >= min_neighbours; });
    }
  });

  std::vector<int64_t> nearest_core(count, kNoise);
  tbb::parallel_for(tbb::blocked_range<uint32_t>(0, count, 256), [&](const auto& range) {
    for (uint32_t i = range.begin(); i != range.end(); ++i) {
      if (core[i]) {
        nearest_core[i] = i;
        continue;
      }
      double best = std::numeric_limits<double>::infinity();
      grid.ForEachNeighbour(i, [&](uint32_t j, double squared) {
        if (core[j] && (squared < best || (squared == best && j < nearest_core[i]))) {
          best = squared;
          nearest_core[i] = j;
        }
      });
    }
  });
  DisjointSets sets(count);
  for (uint32_t i = 0; i < count; ++i) {
    if (!core[i]) continue;
    grid.ForEachPartner(i, [&](uint32_t j) {
      if (core[j]) sets.Unite(i, j);
    });
  }

  Clusters clusters{.ids = std::vector<int32_t>(count, kNoise)};
  for (uint32_t i = 0; i < count; ++i) {
    if (core[i] && sets.Root(i) == i) clusters.ids[i] = clusters.count++;
  }
  for (uint32_t i = 0; i < count; ++i) {
    if (nearest_core[i] != kNoise) clusters.ids[i] = clusters.ids[sets.Root(static_cast<uint32_t>(nearest_core[i]))];
  }
  return clusters;
}

}  // namespace mapkeep
