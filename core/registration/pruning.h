#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace mapkeep {

/// A point of the source and where a match says it lies in the target. Metres.
struct PointPair {
  Eigen::Vector3d source, target;
};

/// Which pairs could come from one rigid motion: an edge joins two if the distance between their source points equals
/// that between their target points within twice the noise bound. A symmetric bit matrix without diagonal.
class CompatibilityGraph {
 public:
  /// Parallel on the calling oneTBB arena (each task owns whole rows); the same on any number of threads.
  CompatibilityGraph(std::span<const PointPair> pairs, double noise_bound);

  size_t size() const { return size_; }
  bool Joined(size_t a, size_t b) const { return (Row(a)[b / 64] >> (b % 64) & 1) != 0; }
  std::span<const uint64_t> Row(size_t vertex) const { return {bits_.data() + vertex * words_, words_}; }

 private:
  size_t size_ = 0;
  size_t words_ = 0;  // of a row
  std::vector<uint64_t> bits_;
};

/// The vertices of the core with the largest k: a set in which each is joined to at least k others of the set. Only
/// vertices with `alive` set take part. Ascending; empty if no edge is left. Bin sort and peeling after Batagelj and
/// Zaversnik (2003).
std::vector<uint32_t> LargestCore(const CompatibilityGraph& graph, std::span<const uint8_t> alive);

}  // namespace mapkeep
