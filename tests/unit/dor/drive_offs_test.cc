#include "core/dor/drive_offs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <tuple>
#include <vector>

namespace mapkeep {
namespace {

constexpr uint32_t kScans = 120;
constexpr uint32_t kLeft = 60;  // the scan at which the car leaves

// Hits voxel by voxel, as if a session of 120 scans had given them; 0.2 m.
class Street {
 public:
  // The skin of a car of 4.2 x 1.8 x 1.4 m whose rear right corner is at `x`, `y`.
  void AddCar(int x, int y, uint32_t last_hit) {
    for (int i = 0; i < 21; ++i) {
      for (int j = 0; j < 9; ++j) {
        for (int k = 0; k < 7; ++k) {
          if (i == 0 || i == 20 || j == 0 || j == 8 || k == 6) Add({x + i, y + j, 3 + k}, true, 0, last_hit);
        }
      }
    }
  }

  void AddWall(int x, int y, int length, uint32_t last_hit) {
    for (int i = 0; i < length; ++i) {
      for (int k = 0; k < 10; ++k) Add({x + i, y, 3 + k}, true, 0, last_hit);
    }
  }

  // A front of 1.8 x 1.2 m that moved along x from `x`, and is first seen in a voxel `reaches(metres on the way)` scans
  // after the beginning.
  void AddTrail(int x, int y, const std::function<double(double metres)>& reaches) {
    for (int i = 0; i < 25; ++i) {
      const auto at = static_cast<uint32_t>(reaches(0.2 * i));
      for (int j = 0; j < 9; ++j) {
        for (int k = 0; k < 6; ++k) Add({x + i, y + j, 3 + k}, false, at, at + 2);
      }
    }
  }

  // Gives by voxel whether it drove off.
  std::function<bool(VoxelIndex)> DroveOff(bool ordered = true) {
    VoxelGrid grid;
    for (const auto& [at, voxel] : voxels_) grid.Insert(voxel.index);
    grid.Finish();
    VoxelCounts counts{.ordered = ordered};
    for (auto* column : {&counts.hits, &counts.exposures, &counts.first_hit, &counts.last_hit}) {
      column->resize(grid.size());
    }
    std::vector<VoxelIndex> indices(grid.size());
    std::vector<char> is_static(grid.size()), is_dynamic(grid.size());
    for (const auto& [at, voxel] : voxels_) {
      const uint32_t id = grid.Find(voxel.index);
      indices[id] = voxel.index;
      counts.hits[id] = voxel.last_hit - voxel.first_hit + 1;
      counts.first_hit[id] = voxel.first_hit;
      counts.last_hit[id] = voxel.last_hit;
      (voxel.stands ? is_static : is_dynamic)[id] = 1;
    }
    std::map<std::tuple<int, int, int>, bool> gone;
    const std::vector<char> left = FindDriveOffs(grid, indices, counts, is_static, is_dynamic, {});
    for (uint32_t id = 0; id < grid.size(); ++id) gone[{indices[id].x, indices[id].y, indices[id].z}] = left[id] != 0;
    return [gone](VoxelIndex v) { return gone.at({v.x, v.y, v.z}); };
  }

 private:
  struct Voxel {
    VoxelIndex index;
    bool stands = true;
    uint32_t first_hit = 0, last_hit = 0;
  };

  void Add(VoxelIndex index, bool stands, uint32_t first_hit, uint32_t last_hit) {
    voxels_.try_emplace({index.x, index.y, index.z}, Voxel{index, stands, first_hit, last_hit});
  }

  std::map<std::tuple<int, int, int>, Voxel> voxels_;
};

// Scans at ten a second until something that starts from rest at kLeft has come so far.
double FromRest(double metres) { return kLeft + 10 * std::sqrt(2 * metres / 1.8); }

TEST(DriveOffs, ACarLeavesWithWhatSetsOutBesideItWhenItWasLastSeen) {
  Street street;
  street.AddCar(0, 0, kLeft);
  street.AddTrail(21, 1, FromRest);
  const auto gone = street.DroveOff();
  EXPECT_TRUE(gone({20, 4, 5})) << "its front";
  EXPECT_TRUE(gone({0, 4, 5})) << "its rear";
  EXPECT_TRUE(gone({10, 8, 4})) << "its side";
}

TEST(DriveOffs, TheNextCarInTheRowStays) {
  Street street;
  street.AddCar(0, 0, kLeft);
  street.AddCar(-22, 0, kScans - 1);
  street.AddTrail(21, 1, FromRest);
  const auto gone = street.DroveOff();
  EXPECT_TRUE(gone({20, 4, 5}));
  EXPECT_FALSE(gone({-22, 4, 5}));
  EXPECT_FALSE(gone({-10, 8, 4}));
}

TEST(DriveOffs, WhatItTouchesAndIsSeenLaterStays) {
  Street street;
  street.AddCar(0, 0, kLeft);
  street.AddWall(-15, 4, 15, kScans - 1);
  street.AddTrail(21, 1, FromRest);
  const auto gone = street.DroveOff();
  EXPECT_TRUE(gone({20, 4, 5}));
  EXPECT_FALSE(gone({-10, 4, 5}));
  EXPECT_FALSE(gone({-1, 4, 5}));
}

TEST(DriveOffs, ACarThatIsSeenLaterStays) {
  Street street;
  street.AddCar(0, 0, kLeft + 30);
  street.AddTrail(21, 1, FromRest);
  EXPECT_FALSE(street.DroveOff()({20, 4, 5}));
}

TEST(DriveOffs, ACarThatIsLastSeenWhenAnotherDrivesByStays) {
  Street street;
  street.AddCar(0, 0, kLeft);
  street.AddTrail(21, 1, [](double metres) { return kLeft + 10 * metres / 8; });  // at 8 m/s
  EXPECT_FALSE(street.DroveOff()({20, 4, 5}));
}

TEST(DriveOffs, ACarThatAnotherComesUpToStays) {
  Street street;
  street.AddCar(0, 0, kLeft);
  street.AddTrail(21, 1, [](double metres) { return kLeft + 20 - 4 * metres; });  // and hides it
  EXPECT_FALSE(street.DroveOff()({20, 4, 5}));
}

TEST(DriveOffs, ACarThatGoesOutOfSightAtTheEndOfTheSessionStays) {
  Street street;
  street.AddCar(0, 0, kScans - 10);
  street.AddTrail(21, 1, [](double metres) { return std::min(kScans - 3.0, FromRest(metres) + kScans - 10 - kLeft); });
  EXPECT_FALSE(street.DroveOff()({20, 4, 5}));
}

TEST(DriveOffs, AWallBesideWhichSomethingSetsOutStays) {
  Street street;
  street.AddWall(-30, 12, 60, kLeft);  // along the way, never seen again either
  street.AddTrail(21, 1, FromRest);
  EXPECT_FALSE(street.DroveOff()({21, 12, 5}));
}

TEST(DriveOffs, WithoutTheOrderOfTheScansNothingDrivesOff) {
  Street street;
  street.AddCar(0, 0, kLeft);
  street.AddTrail(21, 1, FromRest);
  EXPECT_FALSE(street.DroveOff(false)({20, 4, 5}));
}

}  // namespace
}  // namespace mapkeep
