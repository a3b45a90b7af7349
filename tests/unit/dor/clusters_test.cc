#include "core/dor/clusters.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using Points = std::vector<Eigen::Vector3d>;

TEST(Clusters, NothingHasNoClusters) { EXPECT_EQ(ClusterPoints({}, 0.5, 5).count, 0); }

TEST(Clusters, TwoGroupsApartAreTwoClustersAndALonePointIsNoise) {
  const Points points = {{0, 0, 0}, {5, 5, 5}, {0.3, 0, 0}, {-10, 0, 0}, {0.6, 0, 0}, {5, 5.4, 5}, {5, 5, 5.4}};
  const Clusters clusters = ClusterPoints(points, 0.5, 3);
  EXPECT_EQ(clusters.count, 2);
  // Point 4 is the first core point of the row, point 1 of the corner.
  EXPECT_THAT(clusters.ids, ElementsAre(1, 0, 1, kNoise, 1, 0, 0));
}

TEST(Clusters, APointCountsItselfAndTheRadiusIsInclusive) {
  EXPECT_THAT(ClusterPoints(Points{{0, 0, 0}, {0.5, 0, 0}}, 0.5, 2).ids, ElementsAre(0, 0));
  EXPECT_THAT(ClusterPoints(Points{{0, 0, 0}, {0.5, 0, 0}}, 0.5, 3).ids, ElementsAre(kNoise, kNoise));
  EXPECT_THAT(ClusterPoints(Points{{0, 0, 0}, {0.51, 0, 0}}, 0.5, 2).ids, ElementsAre(kNoise, kNoise));
}

TEST(Clusters, ABorderPointJoinsItsNearestCoreAndDoesNotJoinClusters) {
  // Two dense ends, and one point that is in reach of one core of each but has too few neighbours to be core itself.
  Points points = {{0, 0, 0},   {0.1, 0, 0}, {0.2, 0, 0}, {0.1, 0.1, 0},
                   {1.1, 0, 0}, {1.2, 0, 0}, {1.3, 0, 0}, {1.2, 0.1, 0}};
  points.emplace_back(0.64, 0, 0);
  const Clusters clusters = ClusterPoints(points, 0.47, 4);
  EXPECT_EQ(clusters.count, 2);
  EXPECT_EQ(clusters.ids.back(), clusters.ids[0]);
  EXPECT_NE(clusters.ids[4], clusters.ids[0]);
}

// The definition, pair by pair.
std::vector<std::vector<size_t>> ByDefinition(const Points& points, double epsilon, int min_neighbours) {
  const size_t n = points.size();
  const auto near = [&](size_t i, size_t j) { return (points[i] - points[j]).squaredNorm() <= epsilon * epsilon; };
  std::vector<bool> core(n);
  for (size_t i = 0; i < n; ++i) {
    int neighbours = 0;
    for (size_t j = 0; j < n; ++j) neighbours += near(i, j);
    core[i] = neighbours >= min_neighbours;
  }
  std::vector<bool> seen(n);
  std::vector<std::vector<size_t>> clusters;
  for (size_t start = 0; start < n; ++start) {
    if (!core[start] || seen[start]) continue;
    std::vector<size_t> members = {start};
    seen[start] = true;
    for (size_t at = 0; at < members.size(); ++at) {
      for (size_t j = 0; j < n; ++j) {
        if (core[j] && !seen[j] && near(members[at], j)) {
          seen[j] = true;
          members.push_back(j);
        }
      }
    }
    std::ranges::sort(members);
    clusters.push_back(members);
  }
  return clusters;
}

TEST(Clusters, CoresAreGroupedAsTheDefinitionSays) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-3, 3);
  for (int round = 0; round < 5; ++round) {
    Points points(400);
    for (auto& point : points) point = {any(random), any(random), any(random) / 4};
    const Clusters clusters = ClusterPoints(points, 0.5, 5);
    const auto expected = ByDefinition(points, 0.5, 5);
    ASSERT_EQ(clusters.count, static_cast<int32_t>(expected.size()));
    for (size_t c = 0; c < expected.size(); ++c) {
      for (const size_t member : expected[c]) ASSERT_EQ(clusters.ids[member], static_cast<int32_t>(c));
    }
  }
}

TEST(Clusters, MembershipDoesNotDependOnTheOrderOfThePoints) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> any(-2, 2);
  Points points(300);
  for (auto& point : points) point = {any(random), any(random), any(random) / 4};
  const Clusters forward = ClusterPoints(points, 0.4, 5);
  Points turned(points.rbegin(), points.rend());
  const Clusters backward = ClusterPoints(turned, 0.4, 5);
  ASSERT_EQ(forward.count, backward.count);
  for (size_t i = 0; i < points.size(); ++i) {
    for (size_t j = 0; j < points.size(); ++j) {
      ASSERT_EQ(forward.ids[i] == forward.ids[j],
                backward.ids[points.size() - 1 - i] == backward.ids[points.size() - 1 - j]);
    }
  }
}

}  // namespace
}  // namespace mapkeep
