#include "core/registration/wall_plan.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace mapkeep {
namespace {

using Points = std::vector<Eigen::Vector3d>;

WallPlan JoinedOf(std::vector<PlanPart> parts) {
  std::vector<std::shared_ptr<const PlanPart>> shared;
  for (PlanPart& part : parts) shared.push_back(std::make_shared<const PlanPart>(std::move(part)));
  return WallPlan(shared);
}

TEST(PlanOf, TwoPointsOfAFacadeAreAWallInTheCellThatFacesTheirWay) {
  const Points points{{4.1, -0.3, 1}, {4.3, -0.1, 2}};
  const PlanPart plan = PlanOf(points, Points(2, Eigen::Vector3d(0, 1, 0)));
  ASSERT_EQ(plan.walls.size(), 1U);
  // 4.1 / 0.4 and 4.3 / 0.4 lie in cell 10, -0.3 and -0.1 in cell -1; y is a quarter of a turn from x: facing 4 of 16.
  EXPECT_EQ(plan.walls[0], (PlanWall{10, -1, 1U << 4}));
  EXPECT_TRUE(plan.floors.empty());
}

TEST(PlanOf, APointAloneIsNoWallNorAreTwoThatFaceApart) {
  const Points points{{0.1, 0.1, 1}, {0.1, 0.1, 2}};
  EXPECT_TRUE(PlanOf(Points{points[0]}, Points{{0, 1, 0}}).walls.empty());
  EXPECT_TRUE(PlanOf(points, Points{{0, 1, 0}, {0, -1, 0}}).walls.empty());
}

TEST(PlanOf, BetweenTwoFacingsBothCount) {
  const double angle = 2 * std::numbers::pi / 16 * 2.45;
  const Points normals(2, Eigen::Vector3d(std::cos(angle), std::sin(angle), 0));
  const PlanPart plan = PlanOf(Points(2, Eigen::Vector3d(0.1, 0.1, 1)), normals);
  ASSERT_EQ(plan.walls.size(), 1U);
  EXPECT_EQ(plan.walls[0].facings, (1U << 2) | (1U << 3));
}

TEST(PlanOf, TheLowestGroundOfAFloorCellIsItsHeight) {
  const Points points{{1.7, 1.7, 0.5}, {2.0, 3.1, 0.25}, {-0.1, 0.1, -1}};
  const PlanPart plan = PlanOf(points, Points(3, Eigen::Vector3d::UnitZ()));
  ASSERT_EQ(plan.floors.size(), 2U);
  EXPECT_EQ(plan.floors[0], (PlanFloor{-1, 0, -1.F})) << "cells of 1.6 m";
  EXPECT_EQ(plan.floors[1], (PlanFloor{1, 1, 0.25F}));
}

TEST(PlanOf, WhatHasNoNormalOrNoPlaceIsLeftOut) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Points points{{1, 1, 1}, {nan, 0, 0}, {1e12, 0, 0}};
  const PlanPart plan = PlanOf(points, Points{{0, 0, 0}, {0, 0, 1}, {0, 0, 1}});
  EXPECT_TRUE(plan.walls.empty());
  EXPECT_TRUE(plan.floors.empty());
}

TEST(WallPlan, JoinsPartsAcrossTilesAndBelowZero) {
  const WallPlan plan = JoinedOf({{.walls = {{-1, -1, 1}, {63, 0, 2}}, .floors = {{-1, -1, 4.F}}},
                                  {.walls = {{-1, -1, 8}, {64, 0, 4}}, .floors = {{-1, -1, 3.F}, {16, 0, 7.F}}}});
  EXPECT_EQ(plan.WallsAt(-1, -1), 9);
  EXPECT_EQ(plan.WallsAt(63, 0), 2);
  EXPECT_EQ(plan.WallsAt(64, 0), 4);
  EXPECT_EQ(plan.WallsAt(0, 0), 0);
  EXPECT_EQ(plan.WallsAt(5000, 5000), 0) << "no tile there";
  EXPECT_EQ(plan.FloorAt(-1, -1), 3.F) << "the lower one";
  EXPECT_EQ(plan.FloorAt(16, 0), 7.F);
  EXPECT_FALSE(plan.FloorAt(0, 0).has_value());
  EXPECT_EQ(plan.tiles_with_floor(), (std::vector<WallPlan::TileIndex>{{-1, -1}, {1, 0}}));
}

}  // namespace
}  // namespace mapkeep
