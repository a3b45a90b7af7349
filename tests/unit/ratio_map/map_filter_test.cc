#include "core/ratio_map/map_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "core/ratio_map/merge.h"

namespace mapkeep {
namespace {

constexpr MapFilterParameters kDefaults;

/// A whole map in memory, changed voxel by voxel and filtered block by block as a commit does.
class Map {
 public:
  void Put(const VoxelIndex& at, Voxel voxel) {
    voxel.position = PositionInBlock(at);
    Block& block = BlockAt(BlockKeyOf(BlockOf(at)));
    const auto place = std::ranges::lower_bound(block.voxels, voxel.position, {}, &Voxel::position);
    if (place != block.voxels.end() && place->position == voxel.position) {
      *place = voxel;
    } else {
      block.voxels.insert(place, voxel);
    }
  }

  void Merge(const SessionMap& session) {
    for (auto begin = session.voxels.begin(); begin != session.voxels.end();) {
      const BlockKey key = BlockKeyOf(begin->key);
      const auto end = std::find_if(begin, session.voxels.end(), [&](auto& v) { return BlockKeyOf(v.key) != key; });
      BlockAt(key) = MergeBlock(BlockAt(key), {begin, end}, session, MergeParameters{});
      begin = end;
    }
  }

  void FilterAll(const MapFilterParameters& parameters = kDefaults) {
    for (auto& [key, block] : blocks_) Filter(key, parameters);
  }

  void FilterAround(const std::set<BlockKey>& touched) {
    std::set<BlockKey> affected;
    for (const BlockKey key : touched) {
      for (const VoxelIndex& at : NeighbourhoodOf(BlockIndexOf(key))) {
        if (blocks_.contains(BlockKeyOf(at))) affected.insert(BlockKeyOf(at));
      }
    }
    for (const BlockKey key : affected) Filter(key, kDefaults);
  }

  /// The voxel, or nullptr.
  const Voxel* At(const VoxelIndex& at) const {
    const auto found = blocks_.find(BlockKeyOf(BlockOf(at)));
    return found == blocks_.end() ? nullptr : FindVoxel(found->second, PositionInBlock(at));
  }

  bool IsStatic(const VoxelIndex& at) const { return At(at) != nullptr && At(at)->is_static; }

  bool operator==(const Map&) const = default;

 private:
  Block& BlockAt(BlockKey key) { return blocks_.try_emplace(key, Block{.key = key}).first->second; }

  void Filter(BlockKey key, const MapFilterParameters& parameters) {
    BlockNeighbourhood blocks{};
    const auto around = NeighbourhoodOf(BlockIndexOf(key));
    for (int i = 0; i < 27; ++i) {
      const auto found = blocks_.find(BlockKeyOf(around[i]));
      if (found != blocks_.end()) blocks[i] = &found->second;
    }
    Block& block = blocks_.at(key);
    const std::vector<MapVerdict> verdicts = FilterBlock(blocks, parameters);
    ASSERT_EQ(verdicts.size(), block.voxels.size());
    for (size_t i = 0; i < verdicts.size(); ++i) {
      block.voxels[i].is_static = verdicts[i] == MapVerdict::kStatic;
      block.voxels[i].is_new = verdicts[i] == MapVerdict::kNew;
    }
  }

  std::map<BlockKey, Block> blocks_;
};

Voxel Counts(double hits, double exposures) {
  return {.hits = static_cast<uint16_t>(hits * kCountScale),
          .exposures = static_cast<uint16_t>(exposures * kCountScale),
          .mean = {128, 128, 128}};
}

// The voxels [from, from + size) as a list.
std::vector<VoxelIndex> Box(const VoxelIndex& from, const VoxelIndex& size) {
  std::vector<VoxelIndex> box;
  for (int z = 0; z < size.z; ++z) {
    for (int y = 0; y < size.y; ++y) {
      for (int x = 0; x < size.x; ++x) box.push_back({from.x + x, from.y + y, from.z + z});
    }
  }
  return box;
}

SessionMap SessionOf(const std::vector<VoxelIndex>& voxels, uint32_t hits, uint32_t exposures) {
  SessionMap session{.voxel_size = 0.2, .n_max = 20};
  for (const VoxelIndex& at : voxels) {
    session.voxels.push_back(
        {.key = VoxelKeyOf(at), .hits = hits, .exposures = exposures, .mean = {128, 128, 128}, .mask = 1});
  }
  std::ranges::sort(session.voxels, {}, &SessionVoxel::key);
  return session;
}

int StaticCount(const Map& map, const std::vector<VoxelIndex>& voxels) {
  return static_cast<int>(std::ranges::count_if(voxels, [&](const VoxelIndex& at) { return map.IsStatic(at); }));
}

TEST(MapFilter, AParkedCarAloneInItsBlockDisappearsAfterOneContrarySessionOfEqualWeight) {
  const auto car = Box({8, 8, 8}, {10, 5, 6});
  Map map;
  map.Merge(SessionOf(car, 20, 0));
  map.FilterAll();
  EXPECT_EQ(StaticCount(map, car), 300);
  map.Merge(SessionOf(car, 0, 20));  // gone; R = 2 / 22
  map.FilterAll();
  EXPECT_EQ(StaticCount(map, car), 0);
}

TEST(MapFilter, AWallThatOneSessionDidNotSeeStays) {
  const auto wall = Box({0, 5, 0}, {30, 1, 10}), elsewhere = Box({0, 20, 0}, {30, 1, 10});
  Map map;
  map.Merge(SessionOf(wall, 20, 0));
  map.Merge(SessionOf(elsewhere, 20, 0));
  map.FilterAll();
  EXPECT_EQ(StaticCount(map, wall), 300);
}

TEST(MapFilter, AWallThatAFewRaysMissStays) {
  // 20 scans hit it, then 2 look past its edge: alpha = exp(-0.4) = 0.67, H = 13.4, E = 2, R = 0.87.
  const auto wall = Box({0, 5, 0}, {30, 1, 10});
  Map map;
  map.Merge(SessionOf(wall, 20, 0));
  map.Merge(SessionOf(wall, 0, 2));
  map.FilterAll();
  EXPECT_EQ(StaticCount(map, wall), 300);
}

constexpr MapFilterParameters kProbation{.probation_height = 3, .probation_width = 0};
constexpr uint32_t kFirstDay = 1440, kSecondDay = 2880;

Voxel SeenOn(uint32_t first, uint32_t last, bool ground = false) {
  Voxel voxel = Counts(20, 0);
  voxel.ground = ground;
  voxel.first_seen = first;
  voxel.last_seen = last;
  return voxel;
}

// A road of 4 x 4 m that the first day knew, and 1 m beyond it, that it did not, with a wall behind.
Map Road() {
  Map map;
  for (const VoxelIndex& at : Box({0, 0, 4}, {20, 20, 1})) map.Put(at, SeenOn(kFirstDay, kSecondDay, true));
  for (const VoxelIndex& at : Box({0, 20, 4}, {20, 5, 1})) map.Put(at, SeenOn(kSecondDay, kSecondDay, true));
  for (const VoxelIndex& at : Box({0, 25, 5}, {20, 1, 10})) map.Put(at, SeenOn(kFirstDay, kSecondDay));
  return map;
}

int NewCount(const Map& map, const std::vector<VoxelIndex>& voxels) {
  return static_cast<int>(std::ranges::count_if(voxels, [&](const VoxelIndex& at) { return map.At(at)->is_new; }));
}

TEST(MapFilter, WhatStandsWhereGroundWasKnownWaitsForASecondSession) {
  const auto person = Box({8, 8, 5}, {2, 2, 8});
  Map map = Road();
  for (const VoxelIndex& at : person) map.Put(at, SeenOn(kSecondDay, kSecondDay));
  map.FilterAll(kProbation);
  EXPECT_EQ(NewCount(map, person), 32);
  EXPECT_EQ(StaticCount(map, person), 0);
  for (const VoxelIndex& at : person) map.Put(at, SeenOn(kSecondDay, kSecondDay + 1440));
  map.FilterAll(kProbation);
  EXPECT_EQ(NewCount(map, person), 0);
  EXPECT_EQ(StaticCount(map, person), 32);
}

TEST(MapFilter, ACarIsInTodaysMapWhileAPersonWaits) {
  const auto person = Box({3, 3, 5}, {3, 3, 8}), car = Box({10, 3, 5}, {8, 16, 6});
  const MapFilterParameters narrow{.probation_height = 3, .probation_width = 1.6};
  Map map = Road();
  for (const VoxelIndex& at : person) map.Put(at, SeenOn(kSecondDay, kSecondDay));
  for (const VoxelIndex& at : car) map.Put(at, SeenOn(kSecondDay, kSecondDay));
  map.FilterAll(narrow);
  EXPECT_EQ(StaticCount(map, person), 0);
  EXPECT_EQ(StaticCount(map, car), static_cast<int>(car.size()));
  map.FilterAll(kProbation);
  EXPECT_EQ(StaticCount(map, car), 0) << "however wide";
}

TEST(MapFilter, WhatFewScansMetWaitsWhereTheMapKnewAnythingNear) {
  const auto near = Box({2, 28, 5}, {16, 2, 4}), far = Box({2, 64, 5}, {16, 2, 4});
  const auto filtered = [&](int scans) {
    Map map = Road();
    for (const auto& lorry : {near, far}) {
      for (const VoxelIndex& at : lorry) {
        Voxel voxel = SeenOn(kSecondDay, kSecondDay);
        voxel.hits = static_cast<uint16_t>(scans * kCountScale);
        map.Put(at, voxel);
      }
    }
    map.FilterAll();
    return map;
  };
  EXPECT_EQ(StaticCount(filtered(1), near), 0) << "behind the wall, where no ground was known";
  EXPECT_EQ(StaticCount(filtered(2), near), 128);
  EXPECT_EQ(StaticCount(filtered(1), far), 128) << "7 m beyond the map";
}

TEST(MapFilter, WhatFewScansMetBesideWhatManyMetIsMoreOfThat) {
  const auto car = Box({2, 28, 5}, {16, 2, 3}), roof = Box({2, 28, 8}, {16, 2, 1});
  Map map = Road();
  for (const VoxelIndex& at : car) map.Put(at, SeenOn(kSecondDay, kSecondDay));
  for (const VoxelIndex& at : roof) {
    Voxel voxel = SeenOn(kSecondDay, kSecondDay);
    voxel.hits = kCountScale;
    map.Put(at, voxel);
  }
  map.FilterAll();
  EXPECT_EQ(StaticCount(map, roof), 32);
}

TEST(MapFilter, GroundOnTopOfKnownGroundWaits) {
  const auto wheel = Box({8, 8, 5}, {2, 1, 1}), beyond = Box({8, 22, 5}, {2, 1, 1});
  Map map = Road();
  for (const VoxelIndex& at : wheel) map.Put(at, SeenOn(kSecondDay, kSecondDay, true));
  for (const VoxelIndex& at : beyond) map.Put(at, SeenOn(kSecondDay, kSecondDay, true));
  map.FilterAll();
  EXPECT_EQ(NewCount(map, wheel), 2);
  EXPECT_EQ(StaticCount(map, beyond), 2) << "on ground that is as new";
  for (const VoxelIndex& at : wheel) map.Put(at, SeenOn(kSecondDay, kSecondDay + 1440, true));
  map.FilterAll();
  EXPECT_EQ(StaticCount(map, wheel), 2);
}

TEST(MapFilter, WhatIsInsideANewerThingIsGoneUntilItIsMetAgain) {
  // A car of the second day, of which one side, the front and the rear were seen; behind the side, what an earlier car
  // left, and before it a post.
  const auto side = Box({4, 6, 5}, {14, 1, 4}), front = Box({4, 7, 5}, {1, 6, 4}), rear = Box({17, 7, 5}, {1, 6, 4});
  const auto old = Box({9, 9, 6}, {3, 2, 2}), post = Box({10, 3, 5}, {1, 1, 8});
  const auto filtered = [&](uint32_t old_last_seen, const MapFilterParameters& parameters = kDefaults) {
    Map map = Road();
    for (const auto& part : {side, front, rear}) {
      for (const VoxelIndex& at : part) map.Put(at, SeenOn(kSecondDay, kSecondDay));
    }
    for (const VoxelIndex& at : old) map.Put(at, SeenOn(kFirstDay, old_last_seen));
    for (const VoxelIndex& at : post) map.Put(at, SeenOn(kFirstDay, kFirstDay));
    map.FilterAll(parameters);
    return map;
  };
  EXPECT_EQ(StaticCount(filtered(kFirstDay), old), 0);
  EXPECT_EQ(StaticCount(filtered(kFirstDay), post), 8) << "the car is on one side of it";
  EXPECT_EQ(StaticCount(filtered(kSecondDay), old), 12) << "met since the car came";
  EXPECT_EQ(StaticCount(filtered(kFirstDay, {.enclosure_reach = 0}), old), 12) << "switched off";
}

TEST(MapFilter, WhatWasLookedThroughBesideANewerThingIsGone) {
  // A wall of the second day, and before it what the first day left.
  const auto wall = Box({4, 9, 5}, {14, 1, 6}), post = Box({10, 6, 6}, {2, 1, 4}), kerb = Box({6, 6, 5}, {2, 1, 1});
  const auto filtered = [&](double exposures, uint32_t last_seen) {
    Map map = Road();
    for (const VoxelIndex& at : wall) map.Put(at, SeenOn(kSecondDay, kSecondDay));
    for (const auto& [part, ground] : {std::pair{post, false}, {kerb, true}}) {
      for (const VoxelIndex& at : part) {
        Voxel voxel = SeenOn(kFirstDay, last_seen, ground);
        voxel.exposures = static_cast<uint16_t>(exposures * kCountScale);
        map.Put(at, voxel);
      }
    }
    map.FilterAll();
    return StaticCount(map, post) + StaticCount(map, kerb);
  };
  EXPECT_EQ(filtered(1, kFirstDay), 0);
  EXPECT_EQ(filtered(0.5, kFirstDay), 10) << "not by a whole scan";
  EXPECT_EQ(filtered(1, kSecondDay), 10) << "met when the wall was";
}

TEST(MapFilter, WhereNothingWasKnownWhatIsNewIsStaticAtOnce) {
  const auto beyond = Box({8, 21, 5}, {2, 2, 8});
  Map map = Road();
  for (const VoxelIndex& at : beyond) map.Put(at, SeenOn(kSecondDay, kSecondDay));
  map.FilterAll(kProbation);
  EXPECT_EQ(StaticCount(map, beyond), 32);
}

TEST(MapFilter, MoreOfWhatIsKnownIsStaticAtOnce) {
  const auto known = Box({8, 8, 5}, {1, 1, 10}), more = Box({9, 8, 5}, {1, 1, 10});
  Map map = Road();
  for (const VoxelIndex& at : known) map.Put(at, SeenOn(kFirstDay, kFirstDay));
  for (const VoxelIndex& at : more) map.Put(at, SeenOn(kSecondDay, kSecondDay));
  map.FilterAll(kProbation);
  EXPECT_EQ(StaticCount(map, known), 10);
  EXPECT_EQ(StaticCount(map, more), 10);
}

TEST(MapFilter, WhatHangsHighAboveKnownGroundIsStaticAtOnce) {
  const auto sign = Box({8, 8, 21}, {2, 2, 4});  // 3.4 m up
  Map map = Road();
  for (const VoxelIndex& at : sign) map.Put(at, SeenOn(kSecondDay, kSecondDay));
  map.FilterAll(kProbation);
  EXPECT_EQ(StaticCount(map, sign), 16);
}

TEST(MapFilter, GroundFarBelowTheProbationHeightKeepsNothingWaiting) {
  const auto road = Box({0, 0, -13}, {20, 20, 1}), sign = Box({8, 8, 0}, {2, 2, 4});
  const auto static_signs = [&](double probation_height) {
    Map map;
    for (const VoxelIndex& at : road) map.Put(at, SeenOn(kFirstDay, kSecondDay, true));
    for (const VoxelIndex& at : sign) map.Put(at, SeenOn(kSecondDay, kSecondDay));
    map.FilterAll({.probation_height = probation_height, .probation_width = 0});
    return StaticCount(map, sign);
  };
  EXPECT_EQ(static_signs(1), 16);
  EXPECT_EQ(static_signs(3), 4) << "the topmost layer is higher up";
}

TEST(MapFilter, NothingWaitsIfNobodyWantsIt) {
  const auto person = Box({8, 8, 5}, {2, 2, 8});
  Map map = Road();
  for (const VoxelIndex& at : person) map.Put(at, SeenOn(kSecondDay, kSecondDay));
  map.FilterAll({.probation_height = 0});
  EXPECT_EQ(StaticCount(map, person), 32);
  map.FilterAll();
  EXPECT_EQ(StaticCount(map, person), 0) << "it stays anyway: the scene proves nothing";
}

TEST(MapFilter, GroundIsProtectedWhateverItsStability) {
  const auto road = Box({0, 0, 0}, {20, 20, 1});
  Map map;
  Voxel voxel = Counts(1, 30);
  voxel.ground = true;
  for (const VoxelIndex& at : road) map.Put(at, voxel);
  map.FilterAll();
  EXPECT_EQ(StaticCount(map, road), 400);
}

TEST(MapFilter, ObjectsAreJudgedByTheirMeanStability) {
  const auto gone = Box({2, 2, 2}, {4, 4, 4}), stays = Box({20, 2, 2}, {4, 4, 4});
  Map map;
  for (const VoxelIndex& at : gone) map.Put(at, at.x % 2 == 0 ? Counts(20, 80) : Counts(36, 64));   // mean 0.28
  for (const VoxelIndex& at : stays) map.Put(at, at.x % 2 == 0 ? Counts(24, 76) : Counts(39, 61));  // mean 0.315
  map.FilterAll();
  EXPECT_EQ(StaticCount(map, gone), 0);
  EXPECT_EQ(StaticCount(map, stays), 64);
}

TEST(MapFilter, AVoxelThatBelongsToNoObjectIsJudgedByItsOwnStability) {
  const auto wall = Box({0, 5, 0}, {30, 1, 10});
  Map map;
  for (const VoxelIndex& at : wall) map.Put(at, Counts(20, 0));
  map.Put({5, 5, 5}, Counts(24, 76));
  map.Put({25, 5, 5}, Counts(26, 74));
  map.FilterAll();
  EXPECT_FALSE(map.IsStatic({5, 5, 5}));
  EXPECT_TRUE(map.IsStatic({25, 5, 5}));
}

TEST(MapFilter, AStrayVoxelIsNoiseButAPoleIsNot) {
  const auto pole = Box({10, 10, 2}, {1, 1, 12});
  Map map;
  map.Put({20, 20, 20}, Counts(20, 0));
  for (const VoxelIndex& at : pole) map.Put(at, Counts(20, 3));
  map.FilterAll();
  EXPECT_FALSE(map.IsStatic({20, 20, 20}));
  EXPECT_EQ(StaticCount(map, pole), 12);
}

TEST(MapFilter, ObjectsAndNeighboursReachAcrossBlocks) {
  Map map;
  map.Put({31, 4, 4}, Counts(20, 0));  // two voxels, each alone in its block
  map.Put({32, 4, 4}, Counts(20, 0));
  const auto car = Box({-2, 20, 20}, {4, 2, 2});  // gone; half in each block
  for (const VoxelIndex& at : car) map.Put(at, Counts(2, 20));
  map.FilterAll();
  EXPECT_TRUE(map.IsStatic({31, 4, 4}));
  EXPECT_TRUE(map.IsStatic({32, 4, 4}));
  EXPECT_EQ(StaticCount(map, car), 0);
}

TEST(MapFilter, TheVerdictDoesNotDependOnOldVerdicts) {
  const auto car = Box({8, 8, 8}, {4, 4, 4});
  Map map;
  Voxel gone = Counts(2, 20);
  for (const VoxelIndex& at : car) {
    gone.is_static = (at.x + at.y) % 2 == 0;
    map.Put(at, gone);
  }
  map.FilterAll();
  EXPECT_EQ(StaticCount(map, car), 0);
}

TEST(MapFilter, FilteringWhatChangedAndItsNeighboursEqualsFilteringTheWholeMap) {
  std::mt19937 random(7);
  const auto any = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
  const auto place = [&] { return VoxelIndex{any(-64, 63), any(-64, 63), any(-32, 63)}; };
  const auto counts = [&] {
    Voxel voxel = Counts(any(1, 20), any(0, 40));
    voxel.ground = any(0, 9) == 0;
    return voxel;
  };
  const auto put_cloud = [&](Map& map, std::set<BlockKey>& touched) {
    const VoxelIndex centre = place();
    for (int i = 0; i < 60; ++i) {
      const VoxelIndex at{centre.x + any(-3, 3), centre.y + any(-3, 3), centre.z + any(-3, 3)};
      map.Put(at, counts());
      touched.insert(BlockKeyOf(BlockOf(at)));
    }
  };
  Map map;
  std::set<BlockKey> all;
  for (int i = 0; i < 300; ++i) put_cloud(map, all);
  map.FilterAll();
  for (int round = 0; round < 20; ++round) {
    std::set<BlockKey> touched;
    put_cloud(map, touched);
    map.FilterAround(touched);
    Map whole = map;
    whole.FilterAll();
    ASSERT_EQ(map, whole) << "round " << round;
  }
}

}  // namespace
}  // namespace mapkeep
