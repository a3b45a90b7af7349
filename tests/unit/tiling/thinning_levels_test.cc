#include "core/tiling/thinning_levels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <tuple>

namespace mapkeep {
namespace {

using Place = std::tuple<int32_t, int32_t, int32_t>;

std::set<Place> PlacesOf(const std::vector<TilePoint>& points) {
  std::set<Place> places;
  for (const TilePoint& point : points) places.insert({point.x, point.y, point.z});
  return places;
}

std::vector<TilePoint> Cloud(int count) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> at(-100, 100);
  std::set<Place> places;
  while (static_cast<int>(places.size()) < count) places.insert({at(random), at(random), at(random)});
  std::vector<TilePoint> points;
  for (const auto& [x, y, z] : places) points.push_back({.x = x, .y = y, .z = z});
  return points;
}

TEST(ThinToLevel, KeepsOnePointOfEachCellAndLosesNone) {
  const std::vector<TilePoint> points = Cloud(3000);
  for (const int level : {1, 3, 6}) {
    const ThinnedPoints thinned = ThinToLevel(points, level);
    std::set<Place> cells, kept_cells;
    for (const TilePoint& p : points) cells.insert({p.x >> level, p.y >> level, p.z >> level});
    for (const TilePoint& p : thinned.kept) kept_cells.insert({p.x >> level, p.y >> level, p.z >> level});
    EXPECT_EQ(kept_cells, cells);
    EXPECT_EQ(thinned.kept.size(), cells.size());
    std::set<Place> all = PlacesOf(thinned.kept);
    all.merge(PlacesOf(thinned.rest));
    EXPECT_EQ(all, PlacesOf(points));
    EXPECT_EQ(thinned.kept.size() + thinned.rest.size(), points.size());
  }
}

TEST(ThinToLevel, WhatACoarseLevelKeepsEveryFinerOneKeeps) {
  const std::vector<TilePoint> points = Cloud(3000);
  std::set<Place> finer = PlacesOf(points);
  for (int level = 0; level < 10; ++level) {
    const std::set<Place> kept = PlacesOf(ThinToLevel(points, level).kept);
    EXPECT_TRUE(std::ranges::includes(finer, kept)) << level;
    finer = kept;
  }
}

TEST(ThinToLevel, InStepsOrAtOnceAndInAnyOrderItKeepsTheSame) {
  std::vector<TilePoint> points = Cloud(3000);
  const std::set<Place> at_once = PlacesOf(ThinToLevel(points, 5).kept);
  EXPECT_EQ(PlacesOf(ThinToLevel(ThinToLevel(points, 2).kept, 5).kept), at_once);
  std::ranges::shuffle(points, std::mt19937(1));
  EXPECT_EQ(PlacesOf(ThinToLevel(points, 5).kept), at_once);
}

TEST(ThinToLevel, LevelZeroKeepsEverything) {
  const std::vector<TilePoint> points = Cloud(100);
  EXPECT_EQ(ThinToLevel(points, 0).kept, points);
  EXPECT_TRUE(ThinToLevel(points, 0).rest.empty());
}

}  // namespace
}  // namespace mapkeep
