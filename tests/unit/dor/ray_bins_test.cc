#include "core/dor/ray_bins.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace mapkeep {
namespace {

using Columns = std::array<std::vector<float>, 3>;

Columns ColumnsOf(const std::vector<Eigen::Vector3d>& vectors) {
  Columns columns;
  for (const auto& vector : vectors) {
    for (int axis = 0; axis < 3; ++axis) columns[axis].push_back(static_cast<float>(vector[axis]));
  }
  return columns;
}

// A solid box of any size: what rays know of a voxel is a box as well.
RayTarget BoxAt(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  RayTarget target({static_cast<float>(low.x()), static_cast<float>(low.y()), static_cast<float>(low.z())}, {0, 0, 0},
                   kFullMask, CodeOf(kFullMask));
  for (int axis = 0; axis < 3; ++axis) target.high[axis] = static_cast<float>(high[axis]);
  return target;
}

RayTarget VoxelAt(int x, int y, int z, uint64_t mask = kFullMask) {
  return {{-0.5F, -0.5F, -0.5F}, {x, y, z}, mask, CodeOf(mask)};
}

// What the rays say of voxels whose middles are so many edges from the sensor.
std::vector<uint8_t> LookAt(RayBins& bins, const std::vector<RayTarget>& voxels,
                            const RayBins::Clearance& clearance = {}, bool sparse = false) {
  RayTargets targets;
  for (const RayTarget& voxel : voxels) targets.Add(voxel, sparse);
  std::vector<uint8_t> seen;
  bins.Look(targets, clearance, seen);
  return seen;
}

// Any ray that passes through an upright box is found, for sensors that look everywhere and ones that look ahead.
TEST(RayBins, FindsEveryBoxThatARayPasses) {
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
    bins.Build(ColumnsOf(ends), 1);
    std::vector<RayTarget> boxes;
    for (int i = 0; i < 2000; ++i) {
      const Eigen::Vector3d centre(place(random), place(random), place(random) / 4);
      const Eigen::Vector3d half(size(random), size(random), size(random));
      boxes.push_back(BoxAt(centre - half, centre + half));
    }
    const std::vector<uint8_t> seen = LookAt(bins, boxes);
    size_t passing = 0;
    for (size_t i = 0; i < boxes.size(); ++i) {
      bool expected = false;
      for (const auto& end : ends) expected |= SeesThrough(Ray(end), boxes[i], 1);
      passing += expected;
      ASSERT_EQ(seen[i] != 0, expected);
    }
    EXPECT_GT(passing, 200U);
  }
}

TEST(RayBins, OneRayIsEnough) {
  RayBins bins;
  bins.Build(ColumnsOf({{5, 0, 0}}), 1);
  EXPECT_EQ(LookAt(bins, {VoxelAt(3, 0, 0), VoxelAt(6, 0, 0), VoxelAt(3, 0, 2)}),
            (std::vector<uint8_t>{RayBins::kSeenThrough, 0, 0}));
  EXPECT_TRUE(bins.MayReach({{3, 0, 0}, 0.1F, 0.1F}));
  EXPECT_FALSE(bins.MayReach({{6, 0, 0}, 0.1F, 0.1F}));
  EXPECT_FALSE(bins.MayReach({{3, 0, 2}, 0.1F, 0.1F}));
}

// A dense fan of rays that all end 40 voxels ahead, and what is added to it.
Columns FanAnd(const std::vector<Eigen::Vector3d>& others) {
  std::vector<Eigen::Vector3d> ends = others;
  for (int y = -100; y <= 100; ++y) {
    for (int z = -100; z <= 100; ++z) ends.emplace_back(40, 0.2 * y, 0.2 * z);
  }
  return ColumnsOf(ends);
}

TEST(RayBins, AVoidIsConfirmedIfAllRaysAroundTheVoxelLeadOn) {
  constexpr RayBins::Clearance kClearance{.around = 1, .behind = 2};
  const auto at = [&](const std::vector<Eigen::Vector3d>& others) {
    RayBins bins;
    bins.Build(FanAnd(others), 0.98F);
    return LookAt(bins, {VoxelAt(20, 0, 0)}, kClearance)[0];
  };
  constexpr uint8_t kBoth = RayBins::kSeenThrough | RayBins::kConfirmed | RayBins::kClear;
  EXPECT_EQ(at({}), kBoth);
  EXPECT_EQ(at({{20, 1.2, 0}}), RayBins::kSeenThrough) << "a return beside the voxel";
  EXPECT_EQ(at({{18, 0, -1.1}}), RayBins::kSeenThrough) << "one before and below it";
  EXPECT_EQ(at({{22, 0.3, 0}}), RayBins::kSeenThrough) << "one close behind it";
  EXPECT_EQ(at({{20, 6, 0}}), kBoth) << "one far beside it";
  EXPECT_EQ(at({{30, 0.3, 0}}), kBoth) << "one far behind it";
  RayBins bins;
  bins.Build(FanAnd({}), 0.98F);
  EXPECT_EQ(LookAt(bins, {VoxelAt(20, 0, 0)})[0], RayBins::kSeenThrough) << "nobody asks";
}

TEST(RayBins, WhereLittleIsOccupiedAnyRayThroughTheVoxelFindsItClear) {
  constexpr RayBins::Clearance kClearance{.around = 1, .behind = 2};
  const std::vector<RayTarget> voxel = {VoxelAt(20, 0, 0, uint64_t{1} << 20)};  // a spot that the rays below miss
  const auto rows = [](int first, int last) {
    std::vector<Eigen::Vector3d> ends;
    for (int z = first; z <= last; ++z) {
      for (int y = -20; y <= 20; ++y) ends.emplace_back(40, y + 0.3, z + 0.3);
    }
    return ends;
  };
  const auto look = [&](std::vector<Eigen::Vector3d> ends, bool sparse) {
    RayBins bins;
    bins.Build(ColumnsOf(ends), 0.98F);
    return LookAt(bins, voxel, kClearance, sparse)[0];
  };
  EXPECT_EQ(look(rows(-20, 20), true), RayBins::kClear);
  EXPECT_EQ(look(rows(-20, 20), false), 0) << "no ray passed what is occupied";
  EXPECT_EQ(look(rows(0, 0), true), 0) << "one row may pass above what is there";
  std::vector<Eigen::Vector3d> beside = rows(-20, 20);
  beside.emplace_back(20, 1.2, 0);
  EXPECT_EQ(look(beside, true), 0) << "a return beside the voxel";
}

TEST(RayBins, AWallAlongTheRaysIsSeenThroughButNoVoid) {
  // The wall lies at y = 2, from 5 to 60 ahead; the sensor looks along it.
  std::vector<Eigen::Vector3d> ends;
  for (double x = 5; x < 60; x += 0.05) {
    for (double z = -2; z <= 2; z += 0.1) ends.emplace_back(x, 2.0, z * x / 20);
  }
  RayBins bins;
  bins.Build(ColumnsOf(ends), 0.98F);
  std::vector<RayTarget> wall;
  for (int x = 8; x < 40; ++x) wall.push_back(VoxelAt(x, 2, 0));
  size_t seen_through = 0;
  for (const uint8_t seen : LookAt(bins, wall, {.around = 1, .behind = 2.5})) {
    seen_through += (seen & RayBins::kSeenThrough) != 0;
    EXPECT_EQ(seen & RayBins::kConfirmed, 0);
  }
  EXPECT_GT(seen_through, 20U);
}

TEST(RayTarget, AMaskIsSeenThroughOnlyWhereItHasPoints) {
  const uint64_t layer = 0xffff;  // the lowest quarter of the voxel
  const RayTarget target = VoxelAt(4, 0, 0, layer);
  EXPECT_TRUE(target.solid());
  EXPECT_FALSE(SeesThrough(Ray(Eigen::Vector3d(8, 0, 0)), target, 1));
  EXPECT_TRUE(SeesThrough(Ray(Eigen::Vector3d(8, 0, -0.8)), target, 1));
  EXPECT_FALSE(SeesThrough(Ray(Eigen::Vector3d(4, 0, -0.4)), target, 1)) << "the ray ends inside";
  // Two opposite corners: the ray along the floor passes between them.
  const uint64_t corners = uint64_t{1} | uint64_t{1} << (3 + 4 * 3);
  EXPECT_FALSE(SeesThrough(Ray(Eigen::Vector3d(8, 0, -0.8)), VoxelAt(4, 0, 0, corners), 1));
}

TEST(RayTarget, KnowsTheBoxOfItsMask) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 1000; ++i) {
    const uint64_t mask = (random() & random() & random()) | 1;
    const MaskBox box = BoxOf(mask);
    const RayTarget target = VoxelAt(7, -3, 2, mask);
    const std::array<float, 3> corner = {6.5F, -3.5F, 1.5F};
    for (int axis = 0; axis < 3; ++axis) {
      ASSERT_EQ(target.low[axis], corner[axis] + 0.25F * static_cast<float>(box.low[axis]));
      ASSERT_EQ(target.high[axis], corner[axis] + 0.25F * static_cast<float>(box.high[axis]));
    }
    ASSERT_EQ(target.solid(), std::popcount(mask) == box.volume());
  }
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
