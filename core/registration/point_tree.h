#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace mapkeep {

/// A k-d tree over points that outlive it (nanoflann, kept out of this header). Points must be finite; there may be
/// none. Queries may come from several threads at once.
class PointTree {
 public:
  struct Match {
    uint32_t index = 0;
    double squared_distance = 0;
  };

  explicit PointTree(std::span<const Eigen::Vector3d> points);
  ~PointTree();
  PointTree(PointTree&&) noexcept;
  PointTree& operator=(PointTree&&) noexcept;

  /// The nearest point closer than `max_distance`, or nothing.
  std::optional<Match> Nearest(const Eigen::Vector3d& query, double max_distance) const;

  /// The nearest point closer than `max_distance`, and how far off the next nearest is (squared; that of `max_distance`
  /// if it is not closer): until a query has moved by half of the difference, its nearest point stays the same.
  struct MatchAndNext {
    std::optional<Match> nearest;
    double next_squared_distance = 0;
  };
  MatchAndNext NearestAndNext(const Eigen::Vector3d& query, double max_distance) const;

  /// The up to `count` nearest points, nearest first.
  std::vector<Match> Nearest(const Eigen::Vector3d& query, int count) const;

 private:
  struct Index;
  std::unique_ptr<Index> index_;
};

}  // namespace mapkeep
