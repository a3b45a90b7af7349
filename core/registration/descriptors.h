#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/registration/match_cloud.h"

namespace mapkeep {

inline constexpr int kFeatureBins = 11;  ///< of each of the three angles between two normals
inline constexpr int kDescriptorSize = 3 * kFeatureBins;

/// The surroundings of a point, in a form that no rigid motion changes: 255 times the share of pairs whose angle falls
/// in each bin, rounded; each group of kFeatureBins sums to about 255. Whole bytes make distances exact, and are what a
/// store keeps.
using Descriptor = std::array<uint8_t, kDescriptorSize>;

/// The angles of two oriented points (Rusu et al., "Fast Point Feature Histograms", 2009, eq. 1), as bins.
struct PairBins {
  int alpha = 0, phi = 0, theta = 0;
  bool operator==(const PairBins&) const = default;
};

/// The bins of a pair: `line` is the unit vector from the first point to the second. The same if the points swap.
PairBins BinsOfPair(const Eigen::Vector3f& line, const Eigen::Vector3f& first_normal,
                    const Eigen::Vector3f& second_normal);

/// One descriptor a point: a fast point feature histogram over the neighbours within `radius` voxels (at most
/// kCellVoxels), those nearer counting more. All zero for a point without neighbours. Parallel on the calling oneTBB
/// arena; the same on any number of threads.
std::vector<Descriptor> DescribePoints(const MatchCloud& cloud, double radius);

/// How much the surroundings look like one plane, in [0, 1]: the mean of the three bins in which all pairs of a plane
/// fall. Such points cannot be told apart. 1 for a point without neighbours.
double FlatnessOf(const Descriptor& descriptor);

}  // namespace mapkeep
