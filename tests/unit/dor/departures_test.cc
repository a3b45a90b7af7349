#include "core/dor/departures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <random>

#include "core/dor/remover.h"
#include "tests/unit/dor/scenes.h"

namespace mapkeep {
namespace {

const Box kWall{{-30, 8, 0}, {30, 8.4, 4}};
const Box kWaiting{{0, 3, 0.2}, {4, 4.8, 1.6}};

// A robot drives slowly past a wall; a car stands before it while `is_there` says so. Ten scans a second.
Session Waiting(const std::function<bool(int)>& is_there, int scans = 40) {
  Session session = Drive(
      scans, [](int i) { return At(0.1 * i, 0, 1.7); },
      [&](int i) {
        World world{.boxes = {kWall}};
        if (is_there(i)) world.boxes.push_back(kWaiting);
        return world;
      },
      48, 720);
  for (int i = 0; i < scans; ++i) session.scans[i].time = 100 + 0.1 * i;
  return session;
}

std::vector<std::vector<PointLabel>> Labels(const Session& session, const DorParameters& parameters = {}) {
  const auto removal = RemoveDynamicObjects(session.source(), session.poses, {}, parameters);
  EXPECT_TRUE(removal.ok()) << removal.status();
  std::vector<std::vector<PointLabel>> labels;
  for (size_t i = 0; i < session.scans.size(); ++i) labels.push_back(removal->Label(i, session.scans[i]));
  return labels;
}

// Share of the points inside a box, 0.4 m above the ground and higher, that are removed.
double RemovedShare(const Session& session, const Box& box, const DorParameters& parameters = {}) {
  const auto labels = Labels(session, parameters);
  double all = 0, removed = 0;
  for (size_t i = 0; i < labels.size(); ++i) {
    for (size_t j = 0; j < labels[i].size(); ++j) {
      const Eigen::Vector3d at = session.poses[i] * session.scans[i].points[j].cast<double>();
      if (((at - box.low).array() < -0.01).any() || ((box.high - at).array() < -0.01).any() || at.z() < 0.4) continue;
      ++all;
      removed += labels[i][j] == PointLabel::kDynamic;
    }
  }
  EXPECT_GT(all, 100);
  return removed / all;
}

// Nor what finds such things as well while they are few scans.
DorParameters WithoutDepartures() {
  DorParameters parameters;
  parameters.departures = parameters.transients = false;
  return parameters;
}

TEST(Departures, ACarThatWaitsForMostOfTheSessionAndLeavesIsRemoved) {
  const Session session = Waiting([](int i) { return i < 30; });
  EXPECT_GT(RemovedShare(session, kWaiting), 0.95);
  EXPECT_LT(RemovedShare(session, kWaiting, WithoutDepartures()), 0.5) << "R alone would do: the scene proves nothing";
  EXPECT_LT(RemovedShare(session, kWall), 0.01);
}

TEST(Departures, ACarThatComesAndStaysIsRemoved) {
  const Session session = Waiting([](int i) { return i >= 10; });
  EXPECT_GT(RemovedShare(session, kWaiting), 0.95);
  EXPECT_LT(RemovedShare(session, kWall), 0.01);
}

// Counts voxel by voxel, as if a session of 100 scans had given them.
struct Counted {
  VoxelGrid grid;
  std::vector<VoxelIndex> voxels;
  VoxelCounts counts{.ordered = true};

  // A layer of voxels that was hit up to a scan, and looked through `late` times from another one on.
  void AddLayer(VoxelIndex corner, int along_x, int along_y, uint32_t last_hit, uint32_t late, uint32_t free_from) {
    for (int i = 0; i < std::max(along_x, along_y); ++i) {
      for (int z = 0; z < 6; ++z) {
        voxels.push_back({corner.x + (along_x > 0 ? i : 0), corner.y + (along_y > 0 ? i : 0), corner.z + z});
        grid.Insert(voxels.back());
        hit_.push_back({last_hit, late, free_from});
      }
    }
  }

  std::vector<char> Departures() {
    grid.Finish();
    for (auto* column :
         {&counts.hits, &counts.exposures, &counts.confirmed, &counts.early, &counts.late, &counts.first_hit,
          &counts.last_hit, &counts.free_until, &counts.free_from, &counts.confirmed_early, &counts.confirmed_late}) {
      column->resize(grid.size());
    }
    for (size_t i = 0; i < voxels.size(); ++i) {
      const uint32_t id = grid.Find(voxels[i]);
      const auto [last_hit, late, free_from] = hit_[i];
      counts.hits[id] = last_hit + 1;
      counts.last_hit[id] = last_hit;
      counts.exposures[id] = counts.late[id] = late;
      counts.free_from[id] = free_from;
      counts.confirmed[id] = counts.confirmed_late[id] = late > 10 ? 2 : 0;
    }
    std::vector<VoxelIndex> indices(grid.size());
    std::vector<char> candidates(grid.size(), 1), is_dynamic(grid.size());
    for (const VoxelIndex& voxel : voxels) indices[grid.Find(voxel)] = voxel;
    for (const auto& [voxel, first] : moving_) {
      const uint32_t id = grid.Find(voxel);
      indices[id] = voxel;
      candidates[id] = 0;
      is_dynamic[id] = 1;
      counts.hits[id] = 1;
      counts.first_hit[id] = counts.last_hit[id] = first;
    }
    return FindDepartures(grid, counts,
                          {.indices = indices,
                           .candidates = candidates,
                           .is_dynamic = is_dynamic,
                           .is_grazed = [this](uint32_t, uint32_t) { return grazed; }},
                          {});
  }

  // Something that moved up from `corner`, and was seen in one scan alone.
  void AddMoving(VoxelIndex corner, uint32_t scan) {
    for (int z = 0; z < 6; ++z) {
      moving_.emplace_back(VoxelIndex{corner.x, corner.y, corner.z + z}, scan);
      grid.Insert(moving_.back().first);
    }
  }

  bool grazed = false;  // whether rays passed along all surfaces when they were first looked through

 private:
  std::vector<std::array<uint32_t, 3>> hit_;
  std::vector<std::pair<VoxelIndex, uint32_t>> moving_;
};

size_t CountOf(const std::vector<char>& departed) { return static_cast<size_t>(std::ranges::count(departed, 1)); }

TEST(Departures, ACarThatHidesThePlaceThatItLeavesGoesIfSomethingSetsOutBesideIt) {
  const auto departed = [](uint32_t sets_out) {
    Counted scene;
    scene.AddLayer({0, 0, 0}, 0, 8, 60, 5, 62);  // hit in every scan, then looked through a few times, never as a void
    scene.AddMoving({-2, 4, 0}, sets_out);
    return CountOf(scene.Departures());
  };
  EXPECT_EQ(departed(61), 48U);
  EXPECT_EQ(departed(20), 0U) << "something that passed long before is no reason";
  EXPECT_EQ(departed(90), 0U) << "nor long after";
}

TEST(Departures, AFaceThatRaysPassAlongStays) {
  // As often as a robot that drives past the rear of a parked car sees along it.
  const auto departed = [](bool grazed) {
    Counted scene;
    scene.AddLayer({0, 0, 0}, 0, 8, 60, 8, 62);
    scene.AddLayer({10, 2, 0}, 0, 1, 60, 12, 62);  // something else leaves, out of its reach, and is a confirmed void
    scene.grazed = grazed;
    return CountOf(scene.Departures());
  };
  EXPECT_GE(departed(false), 48U);
  EXPECT_EQ(departed(true), 6U) << "the other thing alone";
}

TEST(Departures, ACarWhoseFrontIsOutOfSightLongBeforeItLeavesGoesWithItsSideThatIsHardlyLookedThrough) {
  Counted scene;
  scene.AddLayer({0, 0, 0}, 0, 8, 20, 20, 60);  // the front: not seen from scan 20 on, until it is free
  scene.AddLayer({1, 0, 0}, 7, 0, 55, 2, 61);   // the side: seen until the car leaves, then looked through twice
  scene.AddLayer({2, 10, 0}, 6, 0, 99, 0, 0);   // a wall behind, seen all the time
  const std::vector<char> departed = scene.Departures();
  for (const VoxelIndex& voxel : scene.voxels) {
    EXPECT_EQ(departed[scene.grid.Find(voxel)] != 0, voxel.y < 10) << voxel.x << " " << voxel.y << " " << voxel.z;
  }
}

TEST(Departures, WhatNobodyLookedThroughStaysUnlessMuchAroundItLeaves) {
  Counted scene;
  scene.AddLayer({0, 0, 0}, 0, 8, 20, 20, 60);  // the front of a car that left
  scene.AddLayer({1, 0, 0}, 4, 0, 19, 0, 0);    // its floor, never seen again
  scene.AddLayer({0, -6, 0}, 6, 0, 19, 0, 0);   // a hedge beside it, never seen again either
  const std::vector<char> departed = scene.Departures();
  const auto gone = [&](VoxelIndex voxel) { return departed[scene.grid.Find(voxel)] != 0; };
  EXPECT_TRUE(gone({1, 0, 2}));
  for (int x = 0; x < 6; ++x) EXPECT_FALSE(gone({x, -6, 2})) << x;
}

TEST(Departures, ACarThatStaysIsKept) {
  EXPECT_LT(RemovedShare(Waiting([](int) { return true; }), kWaiting), 0.01);
}

TEST(Departures, WithoutTimesNothingDeparts) {
  Session session = Waiting([](int i) { return i < 30; });
  for (Scan& scan : session.scans) scan.time = 0;
  EXPECT_EQ(Labels(session), Labels(session, WithoutDepartures()));
}

TEST(Departures, TheOrderInWhichScansAreGivenChangesNoLabel) {
  const Session session = Waiting([](int i) { return i < 30; });
  const auto labels = Labels(session);
  std::vector<size_t> order(session.scans.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::shuffle(order.begin(), order.end(), std::mt19937(1));
  Session shuffled;
  for (const size_t i : order) {
    shuffled.scans.push_back(session.scans[i]);
    shuffled.poses.push_back(session.poses[i]);
  }
  const auto of_shuffled = Labels(shuffled);
  for (size_t i = 0; i < order.size(); ++i) EXPECT_EQ(of_shuffled[i], labels[order[i]]) << "scan " << order[i];
}

}  // namespace
}  // namespace mapkeep
