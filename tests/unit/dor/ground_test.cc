#include "core/dor/ground.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace mapkeep {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// Anchors a quarter of a metre apart on a surface over a rectangle.
void AddSurface(Points& anchors, double x0, double x1, double y0, double y1,
                const std::function<double(double, double)>& height) {
  for (double x = x0 + 0.1; x < x1; x += 0.25) {
    for (double y = y0 + 0.1; y < y1; y += 0.25) anchors.emplace_back(x, y, height(x, y));
  }
}

TEST(Ground, FlatGroundIsFoundBelowTheSensor) {
  Points anchors;
  AddSurface(anchors, -10, 10, -10, 10, [](double, double) { return -1.7; });
  const Ground ground(anchors, Points{{0, 0, 0}}, {});
  EXPECT_NEAR(ground.sensor_height(), 1.7, 0.1);
  ASSERT_TRUE(ground.HeightNear({5, -3, 0}));
  EXPECT_NEAR(*ground.HeightNear({5, -3, 0}), -1.7, 1e-9);
  EXPECT_FALSE(ground.HeightNear({50, 0, 0}));
}

TEST(Ground, WithoutAnchorsThereIsNone) {
  EXPECT_FALSE(Ground({}, Points{{0, 0, 0}}, {}).HeightNear({0, 0, 0}));
  EXPECT_FALSE(Ground().HeightNear({0, 0, 0}));
}

TEST(Ground, FollowsASlope) {
  Points anchors;
  const auto slope = [](double x, double) { return 0.2 * x; };
  AddSurface(anchors, -20, 20, -10, 10, slope);
  const Ground ground(anchors, Points{{0, 0, 1.7}}, {});
  for (const double x : {-15.0, 0.0, 15.0}) EXPECT_NEAR(*ground.HeightNear({x, 2, slope(x, 2)}), slope(x, 2), 0.06);
}

TEST(Ground, ACarRoofIsNotGround) {
  Points anchors;
  AddSurface(anchors, -10, 10, -10, 10, [](double, double) { return 0.0; });
  AddSurface(anchors, 3, 5, 3, 7, [](double, double) { return 1.5; });
  const Ground ground(anchors, Points{{0, 0, 1.7}}, {});
  EXPECT_NEAR(*ground.HeightNear({4, 5, 1.5}), 0, 1e-9);
}

TEST(Ground, ACarThatCanBeClimbedInStepsIsNotGroundEither) {
  Points anchors;
  AddSurface(anchors, -10, 10, -10, 3, [](double, double) { return 0.0; });
  AddSurface(anchors, -10, 10, 5, 10, [](double, double) { return 0.0; });
  AddSurface(anchors, -10, 3, 3, 5, [](double, double) { return 0.0; });
  // Bumper, bonnet, windscreen, roof: a quarter of a metre higher every half metre.
  const auto top = [](double x, double) { return 0.25 * (1 + std::floor((x - 3) / 0.5)); };
  AddSurface(anchors, 3, 6, 3, 5, top);
  const Ground ground(anchors, Points{{0, 0, 1.7}}, {});
  for (const double x : {4.6, 5.1, 5.6}) EXPECT_LT(*ground.HeightNear({x, 4, top(x, 4)}), 0.6) << "at " << x;
}

TEST(Ground, ARampLeadsToAnUpperStoreyAndBothStoreysAreGround) {
  Points anchors;
  AddSurface(anchors, 0, 40, -10, 10, [](double, double) { return 0.0; });
  AddSurface(anchors, 0, 40, 10, 14, [](double x, double) { return 0.15 * std::min(x, 20.0); });
  AddSurface(anchors, 20, 40, -10, 10, [](double, double) { return 3.0; });
  const Ground ground(anchors, Points{{5, 0, 1.7}, {6, 0, 1.7}}, {});
  EXPECT_NEAR(*ground.HeightNear({30, 0, 0.1}), 0, 1e-9);
  EXPECT_NEAR(*ground.HeightNear({30, 0, 2.9}), 3, 1e-9);
}

TEST(Ground, ContinuesBeyondAGapWhereItWasNotSeen) {
  Points anchors;
  AddSurface(anchors, -10, 5, -10, 10, [](double, double) { return 0.0; });
  AddSurface(anchors, 6, 20, -10, 10, [](double, double) { return 0.1; });
  const Ground ground(anchors, Points{{0, 0, 1.7}}, {});
  EXPECT_NEAR(*ground.HeightNear({15, 0, 0}), 0.1, 1e-9);
}

TEST(Ground, DoesNotDependOnTheOrderOfTheAnchors) {
  Points anchors;
  AddSurface(anchors, -10, 10, -10, 10, [](double x, double y) { return 0.1 * x + 0.05 * y; });
  Points turned = anchors;
  std::ranges::reverse(turned);
  const Points sensors = {{0, 0, 1.7}, {1, 0, 1.8}};
  const Ground a(anchors, sensors, {}), b(turned, sensors, {});
  for (const auto& anchor : anchors) ASSERT_EQ(a.HeightNear(anchor), b.HeightNear(anchor));
}

}  // namespace
}  // namespace mapkeep
