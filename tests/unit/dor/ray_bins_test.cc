#include "core/dor/ray_bins.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace mapkeep {
namespace {

// Every ray that passes through an upright box is offered, for sensors that look everywhere and ones that look ahead.
TEST(RayBins, OffersEveryRayThatPassesTheRegion) {
  std::mt19937 random(5);
  std::normal_distribution<double> any;
  std::uniform_real_distribution<double> place(-12, 12), size(0.05, 3);
  RayBins bins;
  for (const bool ahead : {false, true}) {
    std::vector<Eigen::Vector3d> ends(3000);
    for (auto& end : ends) {
      end = 10 * Eigen::Vector3d(any(random), any(random), 0.3 * any(random));
      if (ahead) end = Eigen::Vector3d(20 + std::abs(end.x()), 0.2 * end.y(), end.z());
    }
    bins.Build(ends, 1);
    size_t passing = 0;
    for (int i = 0; i < 2000; ++i) {
      const Eigen::Vector3d centre(place(random), place(random), place(random) / 4);
      const Eigen::Vector3d half(size(random), size(random), size(random));
      const auto passes = [&](const Ray& ray) {
        double enter = 0, leave = 1;
        for (int axis = 0; axis < 3; ++axis) {
          const double a = (centre[axis] - half[axis]) * ray.inverse[axis];
          const double b = (centre[axis] + half[axis]) * ray.inverse[axis];
          enter = std::max(enter, std::min(a, b));
          leave = std::min(leave, std::max(a, b));
        }
        return enter < leave && leave < 1;
      };
      bool expected = false;
      for (const auto& end : ends) expected |= passes(Ray(end));
      passing += expected;
      const RayBins::Region region{centre, half.head<2>().norm(), half.z()};
      ASSERT_EQ(bins.AnyRay(region, passes), expected);
      ASSERT_GE(bins.MayReach(region), expected);
    }
    EXPECT_GT(passing, 200U);
  }
}

TEST(RayBins, OneRayIsEnough) {
  RayBins bins;
  bins.Build(std::vector<Eigen::Vector3d>{{5, 0, 0}}, 1);
  const auto any = [](const Ray&) { return true; };
  EXPECT_TRUE(bins.AnyRay({{3, 0, 0}, 0.1, 0.1}, any));
  EXPECT_FALSE(bins.AnyRay({{6, 0, 0}, 0.1, 0.1}, any));
  EXPECT_FALSE(bins.AnyRay({{3, 0, 2}, 0.1, 0.1}, any));
}

TEST(RayTarget, AMaskIsSeenThroughOnlyWhereItHasPoints) {
  const Eigen::Vector3d sensor(0.5, 0.5, 0.5);
  const uint64_t layer = 0xffff;  // the lowest quarter of the voxel
  const RayTarget target({4, 0, 0}, layer, sensor);
  EXPECT_TRUE(target.solid);
  EXPECT_FALSE(SeesThrough(Ray({8, 0, 0}), target, 1));
  EXPECT_TRUE(SeesThrough(Ray({8, 0, -0.8}), target, 1));
  EXPECT_FALSE(SeesThrough(Ray({4, 0, -0.4}), target, 1)) << "the ray ends inside";
  // Two opposite corners: the ray along the floor passes between them.
  const uint64_t corners = uint64_t{1} | uint64_t{1} << (3 + 4 * 3);
  EXPECT_FALSE(SeesThrough(Ray({8, 0, -0.8}), RayTarget({4, 0, 0}, corners, sensor), 1));
}

TEST(MaskBox, IsTheBoxAroundTheSetSubVoxels) {
  const MaskBox one = BoxOf(uint64_t{1} << (2 + 4 * 1 + 16 * 3));
  EXPECT_EQ(one.low, (std::array{2, 1, 3}));
  EXPECT_EQ(one.high, (std::array{3, 2, 4}));
  const MaskBox two = BoxOf(uint64_t{1} | uint64_t{1} << (3 + 4 * 2 + 16 * 1));
  EXPECT_EQ(two.low, (std::array{0, 0, 0}));
  EXPECT_EQ(two.high, (std::array{4, 3, 2}));
  EXPECT_EQ(BoxOf(kFullMask).volume(), 64);
}

}  // namespace
}  // namespace mapkeep
