#include "core/dor/remover.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/dor/exposure.h"
#include "tests/unit/dor/scenes.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

const Box kWall{{-30, 8, 0}, {30, 8.4, 4}};
const Box kParked{{2, -6, 0.2}, {6, -4, 1.6}};

Box MovingCar(int scan) { return {{-12 + 1.5 * scan, 2, 0.2}, {-8 + 1.5 * scan, 3.8, 1.6}}; }

// A robot drives along x past a wall and a parked car; another car overtakes it.
Session Street(int scans = 16, int beams = 48) {
  return Drive(
      scans, [](int i) { return At(0.4 * i, 0, 1.7); },
      [](int i) {
        return World{.boxes = {kWall, kParked, MovingCar(i)}};
      },
      beams, 720);
}

bool Inside(const Box& box, const Eigen::Vector3d& p) {
  return ((p - box.low).array() > -0.01).all() && ((box.high - p).array() > -0.01).all();
}

// Share of the session's points in a box (that may move) that are removed.
double RemovedShare(const Session& session, const Removal& removal, const std::function<Box(int)>& box) {
  double all = 0, removed = 0;
  for (size_t i = 0; i < session.scans.size(); ++i) {
    const auto labels = removal.Label(i, session.scans[i]);
    for (size_t j = 0; j < labels.size(); ++j) {
      if (!Inside(box(static_cast<int>(i)), session.poses[i] * session.scans[i].points[j].cast<double>())) continue;
      ++all;
      removed += labels[j] == PointLabel::kDynamic;
    }
  }
  EXPECT_GT(all, 100);
  return removed / all;
}

Removal Remove(const Session& session, const DorParameters& parameters = {}, std::span<const VoxelKey> watched = {}) {
  const auto removal = RemoveDynamicObjects(session.source(), session.poses, watched, parameters);
  EXPECT_TRUE(removal.ok()) << removal.status();
  return *removal;
}

std::vector<std::vector<PointLabel>> Labels(const Session& session, const Removal& removal) {
  std::vector<std::vector<PointLabel>> labels;
  for (size_t i = 0; i < session.scans.size(); ++i) labels.push_back(removal.Label(i, session.scans[i]));
  return labels;
}

TEST(Remover, ACarThatDrivesIsRemovedAndWhatStandsIsKept) {
  const Session session = Street();
  const Removal removal = Remove(session);
  EXPECT_GT(RemovedShare(session, removal, MovingCar), 0.97);
  EXPECT_LT(RemovedShare(session, removal, [](int) { return kParked; }), 0.01);
  EXPECT_LT(RemovedShare(session, removal, [](int) { return kWall; }), 0.01);
  EXPECT_LT(RemovedShare(session, removal, [](int) { return Box{{-20, -3, -0.05}, {20, 7, 0.05}}; }), 0.01);
}

TEST(Remover, ReportsWhatItDid) {
  const Session session = Street();
  const Removal removal = Remove(session);
  uint64_t points = 0, removed = 0;
  LabelCounts counts;
  for (size_t i = 0; i < session.scans.size(); ++i) {
    const auto labels = removal.Label(i, session.scans[i], &counts);
    points += labels.size();
    removed += std::ranges::count(labels, PointLabel::kDynamic);
  }
  EXPECT_EQ(counts.points, points);
  EXPECT_EQ(counts.removed, removed);
  EXPECT_EQ(removal.report().voxels, removal.evidence().keys.size());
  EXPECT_GT(removal.report().ground_voxels, 1000U);
  EXPECT_GT(removal.report().dynamic_voxels, 100U);
}

TEST(Remover, TheEvidenceIsWhatCountEvidenceCounts) {
  const Session session = Street(6);
  const std::vector<VoxelKey> watched = {VoxelKeyOf(*VoxelIndexOf(Eigen::Vector3d(1, 1, 1), 0.2))};
  const Removal removal = Remove(session, {}, watched);
  const auto evidence = CountEvidence(session.source(), session.poses, 0.2, watched);
  ASSERT_TRUE(evidence.ok());
  EXPECT_EQ(removal.evidence().keys, evidence->keys);
  EXPECT_EQ(removal.evidence().hits, evidence->hits);
  EXPECT_EQ(removal.evidence().exposures, evidence->exposures);
  EXPECT_TRUE(std::ranges::binary_search(evidence->keys, watched[0]));
}

TEST(Remover, DoesNotDependOnTheNumberOfThreads) {
  const Session session = Street(10);
  std::vector<std::vector<std::vector<PointLabel>>> all;
  for (const int threads : {1, 2, 4}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    all.push_back(Labels(session, Remove(session)));
    EXPECT_EQ(all.back(), all[0]);
  }
}

TEST(Remover, TheOrderOfTheScansChangesNoLabel) {
  const Session session = Street(10);
  const auto labels = Labels(session, Remove(session));
  std::vector<size_t> order = {4, 9, 0, 7, 2, 1, 8, 3, 6, 5};
  Session shuffled;
  for (const size_t i : order) {
    shuffled.scans.push_back(session.scans[i]);
    shuffled.poses.push_back(session.poses[i]);
  }
  const auto of_shuffled = Labels(shuffled, Remove(shuffled));
  for (size_t i = 0; i < order.size(); ++i) EXPECT_EQ(of_shuffled[i], labels[order[i]]) << "scan " << order[i];
}

TEST(Remover, ASessionOfOneScanLosesNothing) {
  const Session session = Street(1);
  const Removal removal = Remove(session);
  LabelCounts counts;
  removal.Label(0, session.scans[0], &counts);
  EXPECT_GT(counts.points, 0U);
  EXPECT_EQ(counts.removed, 0U);
}

TEST(Remover, AScanOfOnePointIsASession) {
  Session session;
  Add(session, At(0, 0, 0), {{1, 1, 1}});
  EXPECT_EQ(Remove(session).Label(0, session.scans[0]), std::vector{PointLabel::kStatic});
}

TEST(Remover, WindowsAroundEachScanRemoveTheCarAsWell) {
  const Session session = Street(12, 32);
  DorParameters parameters;
  parameters.window_radius = 4;
  const Removal removal = Remove(session, parameters);
  EXPECT_GT(RemovedShare(session, removal, MovingCar), 0.8);
  EXPECT_LT(RemovedShare(session, removal, [](int) { return kParked; }), 0.02);
}

TEST(Remover, AWindowAsLongAsTheSessionIsTheSession) {
  const Session session = Street(8, 24);
  DorParameters parameters;
  parameters.window_radius = 8;
  EXPECT_EQ(Labels(session, Remove(session, parameters)), Labels(session, Remove(session)));
}

TEST(Remover, GroundUnderAnythingDynamicIsLookedThroughForFeet) {
  // Feet beside the moving car reach from 0.2 m down to the ground: in the voxel of the ground layer they go by their
  // height.
  const auto foot = [](int i) { return Box{{-10 + 1.5 * i, 1.9, 0}, {-9.6 + 1.5 * i, 2.2, 0.4}}; };
  const Session session = Drive(
      16, [](int i) { return At(0.4 * i, 0, 1.7); },
      [&](int i) {
        return World{.boxes = {kWall, MovingCar(i), foot(i)}, .ground = [](double, double) { return 0.02; }};
      },
      64, 1440);
  const auto ankle = [&](int i) {
    Box box = foot(i);
    box.low.z() = 0.14;
    box.high.z() = 0.195;
    return box;
  };
  DorParameters without;
  without.verify_ankles = false;
  EXPECT_GE(RemovedShare(session, Remove(session), ankle), RemovedShare(session, Remove(session, without), ankle));
}

TEST(Remover, ACarThatWaitsAndThenLeavesIsRemoved) {
  const auto car = [](int i) {
    const double x = i < 8 ? 4 : 4 + 2.5 * (i - 7);
    return Box{{x, 2, 0.2}, {x + 4, 3.8, 1.6}};
  };
  const Session session = Drive(
      28, [](int i) { return At(0.2 * i, 0, 1.7); },
      [&](int i) {
        return World{.boxes = {kWall, kParked, car(i)}};
      },
      48, 480);
  const Removal removal = Remove(session);
  EXPECT_GT(RemovedShare(session, removal, car), 0.95);
  EXPECT_LT(RemovedShare(session, removal, [](int) { return kParked; }), 0.01);
}

TEST(Remover, ARampIsKeptUnderACarThatDrivesUpIt) {
  const auto ramp = [](double x, double) { return std::clamp(0.15 * (x - 4), 0.0, 3.0); };
  const auto car = [&](int i) {
    const double x = 6 + 0.9 * i, z = ramp(x + 4, 0);
    return Box{{x, 1, z + 0.25}, {x + 4, 2.8, z + 1.6}};
  };
  const Session session = Drive(
      20, [](int i) { return At(0.2 * i, 0, 1.7); }, [&](int i) { return World{.boxes = {car(i)}, .ground = ramp}; },
      96, 1440);
  const Removal removal = Remove(session);
  double ground = 0, lost = 0, on_car = 0, removed = 0;
  for (size_t i = 0; i < session.scans.size(); ++i) {
    const auto labels = removal.Label(i, session.scans[i]);
    for (size_t j = 0; j < labels.size(); ++j) {
      const Eigen::Vector3d point = session.poses[i] * session.scans[i].points[j].cast<double>();
      const bool is_ground = std::abs(point.z() - ramp(point.x(), point.y())) < 0.02;
      const bool gone = labels[j] == PointLabel::kDynamic;
      // Where it was last, nothing has looked through it yet.
      if (!is_ground && i >= 14) continue;
      (is_ground ? ground : on_car) += 1;
      (is_ground ? lost : removed) += gone;
    }
  }
  EXPECT_LT(lost, 0.005 * ground) << lost << " of " << ground;
  EXPECT_GT(removed, 0.85 * on_car) << removed << " of " << on_car;
}

TEST(Remover, EachRefinementCanBeSwitchedOff) {
  const Session session = Street(10, 24);
  DorParameters none;
  none.protect_ground = none.cluster = none.departures = none.inherit = none.surround = none.verify_ankles = false;
  none.restore = none.confirm = none.doubt = false;
  const Removal removal = Remove(session, none);
  EXPECT_EQ(removal.report().ground_voxels, 0U);
  // What is left is R against its threshold, voxel by voxel.
  const Evidence& evidence = removal.evidence();
  LabelCounts counts;
  const auto labels = removal.Label(3, session.scans[3], &counts);
  EXPECT_EQ(counts.restored, 0U);
  for (size_t j = 0; j < labels.size(); ++j) {
    const auto voxel = VoxelIndexOf(session.poses[3] * session.scans[3].points[j].cast<double>(), 0.2);
    const size_t at = std::ranges::lower_bound(evidence.keys, VoxelKeyOf(*voxel)) - evidence.keys.begin();
    const double r = evidence.hits[at] / (evidence.hits[at] + evidence.exposures[at] + none.eta);
    ASSERT_EQ(labels[j] == PointLabel::kDynamic, r < none.stability_threshold) << "point " << j;
  }
}

TEST(Remover, BadInputIsNamed) {
  const Session good = Street(2, 4);
  const auto status = [](const Session& session, const DorParameters& parameters = {}) {
    return RemoveDynamicObjects(session.source(), session.poses, {}, parameters).status();
  };
  EXPECT_TRUE(absl::IsInvalidArgument(status({})));

  Session bad = good;
  bad.poses.pop_back();
  EXPECT_THAT(status(bad).message(), HasSubstr("1 poses for 2 scans"));

  bad = good;
  bad.poses[1].translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(status(bad).message(), HasSubstr("pose 1 is not finite"));

  bad = good;
  bad.scans[1].points[3].y() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(absl::IsInvalidArgument(status(bad)));
  EXPECT_THAT(status(bad).message(), HasSubstr("scan 1: point 3"));

  bad = good;
  bad.scans[0].points[2].z() = 3e5F;
  EXPECT_TRUE(absl::IsOutOfRange(status(bad)));
  EXPECT_THAT(status(bad).message(), HasSubstr("scan 0: point 2"));

  DorParameters parameters;
  parameters.voxel_size = -1;
  EXPECT_THAT(status(good, parameters).message(), HasSubstr("voxel_size is -1, expected 0.01 to 10"));
}

TEST(Remover, AnErrorOfTheSourceIsPassedOnWithItsScan) {
  const Session session = Street(2, 4);
  const ScanSource source{2, [&](size_t i) -> absl::StatusOr<Scan> {
                            if (i == 1) return absl::DataLossError("the file is cut short");
                            return session.scans[i];
                          }};
  const auto status = RemoveDynamicObjects(source, session.poses, {}, {}).status();
  EXPECT_TRUE(absl::IsDataLoss(status));
  EXPECT_THAT(status.message(), HasSubstr("scan 1: the file is cut short"));
}

TEST(Remover, StopsWhenProgressSaysSoAndNeverFalls) {
  const Session session = Street(8, 8);
  std::vector<double> fractions;
  const auto all = RemoveDynamicObjects(session.source(), session.poses, {}, {}, [&](double fraction) {
    fractions.push_back(fraction);
    return true;
  });
  ASSERT_TRUE(all.ok());
  EXPECT_TRUE(std::ranges::is_sorted(fractions));
  EXPECT_DOUBLE_EQ(fractions.back(), 1);
  for (const double stop : {0.1, 0.5, 0.9}) {
    const auto stopped =
        RemoveDynamicObjects(session.source(), session.poses, {}, {}, [&](double fraction) { return fraction < stop; });
    EXPECT_TRUE(absl::IsCancelled(stopped.status())) << stopped.status();
  }
}

}  // namespace
}  // namespace mapkeep
