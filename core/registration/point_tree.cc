#include "core/registration/point_tree.h"

#include <nanoflann.hpp>

namespace mapkeep {
namespace {

// What nanoflann asks of a point set.
struct PointSet {
  std::span<const Eigen::Vector3d> points;

  size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(size_t index, size_t axis) const { return points[index][static_cast<Eigen::Index>(axis)]; }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointSet>, PointSet, 3, uint32_t>;

// nanoflann's result set for one point that must be closer than a limit.
class NearestWithin {
 public:
  using DistanceType = double;
  using IndexType = uint32_t;

  explicit NearestWithin(double squared_limit) : best_{.squared_distance = squared_limit} {}

  size_t size() const { return found_ ? 1 : 0; }
  bool full() const { return true; }
  double worstDist() const { return best_.squared_distance; }
  bool addPoint(double squared_distance, uint32_t index) {
    if (squared_distance < best_.squared_distance) {
      best_ = {index, squared_distance};
      found_ = true;
    }
    return true;
  }
  std::optional<PointTree::Match> result() const { return found_ ? std::optional(best_) : std::nullopt; }

 private:
  PointTree::Match best_;
  bool found_ = false;
};

// The same, with the distance of the runner-up.
class NearestTwoWithin {
 public:
  using DistanceType = double;
  using IndexType = uint32_t;

  explicit NearestTwoWithin(double squared_limit) : best_{.squared_distance = squared_limit}, next_(squared_limit) {}

  size_t size() const { return found_ ? 1 : 0; }
  bool full() const { return true; }
  double worstDist() const { return next_; }
  bool addPoint(double squared_distance, uint32_t index) {
    if (squared_distance < best_.squared_distance) {
      next_ = best_.squared_distance;
      best_ = {index, squared_distance};
      found_ = true;
    } else if (squared_distance < next_) {
      next_ = squared_distance;
    }
    return true;
  }
  PointTree::MatchAndNext result() const { return {found_ ? std::optional(best_) : std::nullopt, next_}; }

 private:
  PointTree::Match best_;
  double next_;
  bool found_ = false;
};

constexpr int kLeafPoints = 16;

}  // namespace

struct PointTree::Index {
  explicit Index(std::span<const Eigen::Vector3d> of)
      : points{of}, tree(3, points, nanoflann::KDTreeSingleIndexAdaptorParams(kLeafPoints)) {}

  PointSet points;
  Tree tree;
};

PointTree::PointTree(std::span<const Eigen::Vector3d> points)
    : index_(points.empty() ? nullptr : std::make_unique<Index>(points)) {}
PointTree::~PointTree() = default;
PointTree::PointTree(PointTree&&) noexcept = default;
PointTree& PointTree::operator=(PointTree&&) noexcept = default;

std::optional<PointTree::Match> PointTree::Nearest(const Eigen::Vector3d& query, double max_distance) const {
  if (index_ == nullptr) return std::nullopt;
  NearestWithin nearest(max_distance * max_distance);
  index_->tree.findNeighbors(nearest, query.data(), nanoflann::SearchParams());
  return nearest.result();
}

PointTree::MatchAndNext PointTree::NearestAndNext(const Eigen::Vector3d& query, double max_distance) const {
  const double limit = max_distance * max_distance;
  if (index_ == nullptr) return {{}, limit};
  NearestTwoWithin nearest(limit);
  index_->tree.findNeighbors(nearest, query.data(), nanoflann::SearchParams());
  return nearest.result();
}

std::vector<PointTree::Match> PointTree::Nearest(const Eigen::Vector3d& query, int count) const {
  if (index_ == nullptr || count <= 0) return {};
  std::vector<uint32_t> indices(count);
  std::vector<double> distances(count);
  const size_t found = index_->tree.knnSearch(query.data(), count, indices.data(), distances.data());
  std::vector<Match> matches(found);
  for (size_t i = 0; i < found; ++i) matches[i] = {indices[i], distances[i]};
  return matches;
}

}  // namespace mapkeep
