#include <gtest/gtest.h>

#include "tests/unit/dor/counted_scene.h"

namespace mapkeep {
namespace {

constexpr VoxelIndex kMiddle{12, 12, 22};

// Where somebody moved: every voxel was hit a few times, then looked through as a void. `middle` is what the scans said
// of the voxel in the middle, which no ray ever passed.
CountedScene Around(const Said& middle) {
  CountedScene scene;
  scene.AddCube({10, 10, 20}, 5, [&](int at) {
    return at == 62 ? middle : Said{.hits = 5, .exposures = 20, .confirmed = 8, .first_hit = 0, .last_hit = 99};
  });
  scene.Finish();
  return scene;
}

DorParameters Undecided(double surrounded_time) {
  DorParameters parameters;
  parameters.surrounded_time = surrounded_time;
  return parameters;
}

TEST(Surround, SomebodyWhoShiftsByHisOwnWidthIsRemovedWhereNoRayEverPassed) {
  const CountedScene person = Around({.hits = 35, .first_hit = 30, .last_hit = 70});
  EXPECT_TRUE(person.IsRemoved(kMiddle));
  EXPECT_FALSE(person.IsRemoved(kMiddle, Undecided(0))) << "it goes anyway: the scene proves nothing";
}

TEST(Surround, APoleThatPeoplePassStays) {
  EXPECT_FALSE(Around({.hits = 90, .first_hit = 0, .last_hit = 99}).IsRemoved(kMiddle));
}

TEST(Surround, WithoutTheOrderOfTheScansNothingIsAPartOfTheTime) {
  CountedScene person = Around({.hits = 35, .first_hit = 30, .last_hit = 70});
  person.counts.ordered = false;
  EXPECT_FALSE(person.IsRemoved(kMiddle));
}

TEST(Surround, FeetAreLookedForThroughAllVoxelsThatTheGroundIsHigh) {
  // Voxels of 0.1 m on a floor 2 m below the sensor: within 0.2 m of it they are ground, and what stands on them moved.
  constexpr int kFloor = -20;
  CountedScene scene;
  for (int x = -20; x < 20; ++x) {
    for (int y = -20; y < 20; ++y) {
      scene.AddCube({x, y, kFloor}, 1, [](int) { return Said{.hits = 50, .first_hit = 0, .last_hit = 99}; });
    }
  }
  scene.AddCube({2, 2, kFloor + 1}, 1, [](int) { return Said{.hits = 5, .first_hit = 40, .last_hit = 45}; });
  for (int z = 2; z < 10; ++z) {
    scene.AddCube({2, 2, kFloor + z}, 1, [](int) {
      return Said{.hits = 5, .exposures = 20, .confirmed = 8, .first_hit = 40, .last_hit = 45};
    });
  }
  scene.Finish();
  DorParameters parameters;
  parameters.voxel_size = 0.1;
  const Verdict verdict = scene.Judged(parameters);
  EXPECT_EQ(verdict.voxels[scene.voxels.grid.Find({2, 2, kFloor + 5})], VoxelVerdict::kDynamic);
  EXPECT_EQ(verdict.voxels[scene.voxels.grid.Find({2, 2, kFloor + 1})], VoxelVerdict::kAnkle);
  EXPECT_EQ(verdict.voxels[scene.voxels.grid.Find({2, 2, kFloor})], VoxelVerdict::kAnkle);
  EXPECT_EQ(verdict.voxels[scene.voxels.grid.Find({8, 8, kFloor})], VoxelVerdict::kGround);
}

}  // namespace
}  // namespace mapkeep
