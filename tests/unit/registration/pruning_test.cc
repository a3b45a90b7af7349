#include "core/registration/pruning.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<uint32_t> LargestCoreOf(const CompatibilityGraph& graph) {
  return LargestCore(graph, std::vector<uint8_t>(graph.size(), 1));
}

TEST(Pruning, JoinsPairsWhoseDistancesAgreeWithinTwiceTheBound) {
  const std::vector<PointPair> pairs = {
      {{0, 0, 0}, {100, 0, 0}}, {{10, 0, 0}, {100, 10.1, 0}}, {{0, 20, 0}, {100, 0, 19.7}}};
  const CompatibilityGraph graph(pairs, 0.1);
  EXPECT_TRUE(graph.Joined(0, 1));   // 10 against 10.1
  EXPECT_FALSE(graph.Joined(0, 2));  // 20 against 19.7
  EXPECT_FALSE(graph.Joined(1, 1));
}

// Two sets of pairs, each moved as a whole (by 100 m along x; by 300 m along y), too far apart to agree with each
// other.
std::vector<PointPair> TwoMotions(int first, int second) {
  std::vector<PointPair> pairs;
  for (int i = 0; i < first; ++i) {
    const Eigen::Vector3d point(3.0 * i, 0.5 * i * i, i % 3);
    pairs.push_back({point, point + Eigen::Vector3d(100, 0, 0)});
  }
  for (int i = 0; i < second; ++i) {
    const Eigen::Vector3d point(2.0 * i, 50 + 0.7 * i * i, i % 2);
    pairs.push_back({point, point + Eigen::Vector3d(0, 300, 0)});
  }
  return pairs;
}

TEST(Pruning, TheLargestCoreIsTheLargestSetThatMovesAsOneAndTheNextIsFoundOnceItIsTaken) {
  const CompatibilityGraph graph(TwoMotions(5, 4), 0.1);
  EXPECT_THAT(LargestCoreOf(graph), ElementsAre(0, 1, 2, 3, 4));
  EXPECT_THAT(LargestCore(graph, std::vector<uint8_t>{0, 0, 0, 0, 0, 1, 1, 1, 1}), ElementsAre(5, 6, 7, 8));
}

TEST(Pruning, RowsLongerThanAWordAreSymmetric) {
  const CompatibilityGraph graph(TwoMotions(80, 70), 0.1);
  for (size_t a = 0; a < graph.size(); ++a) {
    for (size_t b = 0; b < graph.size(); ++b) {
      EXPECT_EQ(graph.Joined(a, b), graph.Joined(b, a));
      if ((a < 80) == (b < 80)) {
        EXPECT_EQ(graph.Joined(a, b), a != b) << a << " " << b;
      }
    }
  }
  const auto core = LargestCoreOf(graph);
  ASSERT_EQ(core.size(), 80);
  EXPECT_EQ(core.front(), 0);
  EXPECT_EQ(core.back(), 79);
}

// A chain 0 - 1 - 2 - 3 - 4 hangs from a triangle 4, 5, 6: only the triangle has two neighbours inside.
TEST(Pruning, AChainFallsOffTheCoreLinkByLink) {
  std::vector<PointPair> pairs = {{{0, 0, 0}, {0, 0, 0}}};
  // Each link keeps its length from the one before, but the target's chain folds, so that other distances differ.
  pairs.push_back({{10, 0, 0}, {10, 0, 0}});
  pairs.push_back({{20, 0, 0}, {10, 10, 0}});
  pairs.push_back({{30, 0, 0}, {0, 10, 0}});
  pairs.push_back({{40, 0, 0}, {0, 10, 10}});
  pairs.push_back({{40, 7, 0}, {0, 10, 17}});
  pairs.push_back({{40, 7, 5}, {5, 10, 17}});
  const CompatibilityGraph graph(pairs, 0.01);
  for (size_t link = 0; link + 1 < 5; ++link) ASSERT_TRUE(graph.Joined(link, link + 1));
  EXPECT_THAT(LargestCoreOf(graph), ElementsAre(4, 5, 6));
}

TEST(Pruning, WithoutAnEdgeThereIsNoCore) {
  EXPECT_THAT(LargestCoreOf(CompatibilityGraph(TwoMotions(1, 1), 0.1)), IsEmpty());
  EXPECT_THAT(LargestCoreOf(CompatibilityGraph(TwoMotions(1, 0), 0.1)), IsEmpty());
  EXPECT_THAT(LargestCoreOf(CompatibilityGraph({}, 0.1)), IsEmpty());
}

}  // namespace
}  // namespace mapkeep
