#include "core/registration/correspondences.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/unit/registration/scene.h"

namespace mapkeep {
namespace {

std::vector<Eigen::Vector3d> CloudOf(int count, std::mt19937& random) {
  std::uniform_real_distribution<double> any(0, 8);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) points.emplace_back(any(random), any(random), any(random));
  return points;
}

// A point's nearest under a motion that goes on in steps of up to `most` metres, as the tree says and as held.
void ExpectTheTreesAnswers(double most, double max_distance) {
  std::mt19937 random(5);
  const auto target = CloudOf(600, random), points = CloudOf(200, random);
  const PointTree tree(target);
  Correspondences pairs(points.size(), target, tree, max_distance);
  std::uniform_real_distribution<double> step(-most / 2, most / 2);
  Eigen::Vector3d moved = Eigen::Vector3d::Zero();
  size_t met = 0;
  for (int round = 0; round < 40; ++round) {
    moved += Eigen::Vector3d(step(random), step(random), step(random));
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d position = points[i] + moved;
      const auto expected = tree.Nearest(position, max_distance);
      const auto found = pairs.Match(i, position);
      ASSERT_EQ(found.has_value(), expected.has_value()) << "round " << round << ", point " << i;
      if (expected) {
        ASSERT_EQ(*found, expected->index) << "round " << round << ", point " << i;
      }
      met += found ? 1 : 0;
    }
  }
  // Both happen: a point near by, and none.
  EXPECT_GT(met, 400U);
  EXPECT_LT(met, 7600U);
}

TEST(Correspondences, AreTheTreesWhileThePointsCreep) { ExpectTheTreesAnswers(0.02, 0.6); }

TEST(Correspondences, AreTheTreesWhenThePointsLeap) { ExpectTheTreesAnswers(1.5, 0.6); }

TEST(Correspondences, OfAnEmptyTargetAreNone) {
  const PointTree tree({});
  Correspondences pairs(1, {}, tree, 1);
  EXPECT_FALSE(pairs.Match(0, {0, 0, 0}));
}

}  // namespace
}  // namespace mapkeep
