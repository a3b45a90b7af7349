#include "core/dor/exposure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <random>

#include "tests/unit/dor/scenes.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

constexpr double kVoxel = 0.2;

// The plain count of the paper: a ray exposes what it passes.
ExposureParameters Plain() { return {.sub_voxels = false, .neighbour_hits = false, .margin_by_range = 0}; }

struct Counts {
  uint32_t hits = 0, exposures = 0;
  bool operator==(const Counts&) const = default;
};

Counts CountsAt(const Evidence& evidence, const Eigen::Vector3d& point) {
  const VoxelKey key = VoxelKeyOf(*VoxelIndexOf(point, evidence.voxel_size));
  const auto at = std::ranges::lower_bound(evidence.keys, key);
  EXPECT_TRUE(at != evidence.keys.end() && *at == key) << "no voxel at " << point.transpose();
  if (at == evidence.keys.end() || *at != key) return {};
  const size_t i = at - evidence.keys.begin();
  return {evidence.hits[i], evidence.exposures[i]};
}

Evidence Count(const Session& session, const ExposureParameters& parameters = {}, std::vector<VoxelKey> watched = {}) {
  std::ranges::sort(watched);
  const auto evidence = CountEvidence(session.source(), session.poses, kVoxel, watched, {}, parameters);
  EXPECT_TRUE(evidence.ok()) << evidence.status();
  return evidence.ok() ? *evidence : Evidence{};
}

const Eigen::Vector3d kNear(2.1, 0.1, 0.1), kFar(6.1, 0.1, 0.1);

TEST(Exposure, WhatIsSeenThroughIsExposedAndWhatReturnsIsHit) {
  Session session;
  Add(session, At(0.1, 0.1, 0.1), {kNear});
  Add(session, At(0.1, 0.1, 0.1), {kFar});
  Add(session, At(0.1, 0.1, 0.1), {kFar});
  const Evidence evidence = Count(session);
  ASSERT_EQ(evidence.keys.size(), 2U);
  EXPECT_EQ(CountsAt(evidence, kNear), (Counts{1, 2}));
  EXPECT_EQ(CountsAt(evidence, kFar), (Counts{2, 0}));
}

TEST(Exposure, AScansOwnHitsWinOverItsExposures) {
  Session session;
  Add(session, At(0.1, 0.1, 0.1), {kNear, kFar});
  const Evidence evidence = Count(session, Plain());
  EXPECT_EQ(CountsAt(evidence, kNear), (Counts{1, 0}));
  EXPECT_EQ(CountsAt(evidence, kFar), (Counts{1, 0}));
}

TEST(Exposure, CountsScansNotPoints) {
  Session session;
  Add(session, At(0.1, 0.1, 0.1), {kNear, kNear + Eigen::Vector3d(0.02, 0, 0)});
  Add(session, At(0.1, 0.1, 0.1), {kFar, kFar + Eigen::Vector3d(0, 0.04, 0), kFar + Eigen::Vector3d(0.9, 0, 0)});
  EXPECT_EQ(CountsAt(Count(session, Plain()), kNear), (Counts{1, 1}));
}

TEST(Exposure, NothingBehindTheReturnIsExposed) {
  Session session;
  Add(session, At(0.1, 0.1, 0.1), {kFar});
  Add(session, At(0.1, 0.1, 0.1), {kNear});
  EXPECT_EQ(CountsAt(Count(session, Plain()), kFar), (Counts{1, 0}));
}

TEST(Exposure, WatchedVoxelsAreExposedWhereTheSessionHasNoPoints) {
  Session session;
  Add(session, At(0.1, 0.1, 0.1), {kFar});
  const Eigen::Vector3d seen(3.1, 0.1, 0.1), hidden(8.1, 0.1, 0.1);
  const Evidence evidence =
      Count(session, {}, {VoxelKeyOf(*VoxelIndexOf(seen, kVoxel)), VoxelKeyOf(*VoxelIndexOf(hidden, kVoxel))});
  ASSERT_EQ(evidence.keys.size(), 3U);
  EXPECT_TRUE(std::ranges::is_sorted(evidence.keys));
  EXPECT_EQ(CountsAt(evidence, seen), (Counts{0, 1}));
  EXPECT_EQ(CountsAt(evidence, hidden), (Counts{0, 0}));
}

TEST(Exposure, ARayPastThePointsOfAVoxelDoesNotExposeIt) {
  // The near voxel spans z in [0, 0.2); its point lies at 0.02, and the second ray passes at 0.15.
  Session session;
  Add(session, At(0.1, 0.1, 0.02), {{2.1, 0.1, 0.02}});
  Add(session, At(0.1, 0.1, 0.15), {{6.1, 0.1, 0.15}});
  EXPECT_EQ(CountsAt(Count(session), {2.1, 0.1, 0.02}), (Counts{1, 0}));
  EXPECT_EQ(CountsAt(Count(session, Plain()), {2.1, 0.1, 0.02}), (Counts{1, 1}));
}

TEST(Exposure, AHitBesideAVoxelShieldsItButOneAboveDoesNot) {
  // Two voxels side by side in y were hit by the first scan; the second scan hits only one of them and looks through
  // the other.
  Session session;
  Add(session, At(0.1, 0.1, 0.1), {kNear});
  Add(session, At(0.1, 0.1, 0.1), {kFar, {2.1, 0.3, 0.1}});
  EXPECT_EQ(CountsAt(Count(session), kNear), (Counts{1, 0}));
  session.scans[1] = ScanOf(session.poses[1], {kFar, {2.1, 0.1, 0.3}});
  EXPECT_EQ(CountsAt(Count(session), kNear), (Counts{1, 1}));
}

TEST(Exposure, ShieldingReachesAcrossBricks) {
  // Voxels 7 and 8 in x lie in different bricks.
  Session session;
  Add(session, At(0.1, 3.1, 0.1), {{1.52, 0.1, 0.1}});
  Add(session, At(1.52, 3.1, 0.1), {{1.52, -3.1, 0.1}, {1.7, 0.1, 0.1}});
  EXPECT_EQ(CountsAt(Count(session), {1.52, 0.1, 0.1}), (Counts{1, 0}));
  session.scans[1] = ScanOf(session.poses[1], {{1.52, -3.1, 0.1}});
  EXPECT_EQ(CountsAt(Count(session), {1.52, 0.1, 0.1}), (Counts{1, 1}));
}

TEST(Exposure, TheMarginBeforeTheReturnGrowsWithRange) {
  // At 40 m the last 0.8 m expose nothing: the voxel 0.6 m before the return is spared, that 1.2 m before it is not.
  const Eigen::Vector3d end(40.1, 0.1, 0.1), close(39.5, 0.1, 0.1), off(38.9, 0.1, 0.1);
  Session session;
  Add(session, At(0.1, 0.1, 0.1), {close});
  Add(session, At(0.1, 0.1, 0.1), {off});
  Add(session, At(0.1, 0.1, 0.1), {end});
  const Evidence evidence = Count(session);
  EXPECT_EQ(CountsAt(evidence, close), (Counts{1, 0}));
  EXPECT_EQ(CountsAt(evidence, off), (Counts{1, 1}));
}

TEST(Exposure, DoesNotDependOnTheNumberOfThreads) {
  const Session session = Drive(
      6, [](int i) { return At(0.5 * i, 0, 1.5); },
      [](int i) {
        return World{.boxes = {{{5.0 + i, 2, 0}, {7.0 + i, 4, 1.5}}}};
      });
  std::vector<Evidence> all;
  for (const int threads : {1, 2, 4}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    all.push_back(Count(session));
    EXPECT_EQ(all.back().keys, all[0].keys);
    EXPECT_EQ(all.back().hits, all[0].hits);
    EXPECT_EQ(all.back().exposures, all[0].exposures);
  }
  EXPECT_GT(all[0].keys.size(), 1000U);
}

TEST(Exposure, ProjectionSeesThroughWhatTheRayWalkSeesThrough) {
  const Session session = Drive(
      8, [](int i) { return At(0.5 * i, 0.03 * i, 1.5); },
      [](int i) {
        return World{.boxes = {{{5.0 + i, 2, 0}, {7.0 + i, 4, 1.5}}, {{-10, 8, 0}, {20, 9, 4}}}};
      },
      48, 700);
  const VoxelKey watched[] = {VoxelKeyOf(*VoxelIndexOf(Eigen::Vector3d(3, 1, 1), kVoxel))};
  for (ExposureParameters parameters : {ExposureParameters{}, Plain()}) {
    const Evidence projected = Count(session, parameters, {watched[0]});
    parameters.engine = ExposureEngine::kRayWalk;
    const Evidence walked = Count(session, parameters, {watched[0]});
    ASSERT_EQ(projected.keys, walked.keys);
    EXPECT_EQ(projected.hits, walked.hits);
    uint64_t differ = 0, all = 0;
    for (size_t i = 0; i < projected.keys.size(); ++i) {
      differ +=
          std::max(projected.exposures[i], walked.exposures[i]) - std::min(projected.exposures[i], walked.exposures[i]);
      all += walked.exposures[i];
    }
    EXPECT_GT(all, 2000U);
    EXPECT_LE(differ, all / 10000) << differ << " of " << all;
  }
}

TEST(Exposure, AScanThatHitsAVoxelWhereItWasHitBeforeNeverLowersItsR) {
  Session session = Drive(
      6, [](int i) { return At(0.5 * i, 0, 1.5); },
      [](int i) {
        return World{.boxes = {{{5.0 + i, 2, 0}, {7.0 + i, 4, 1.5}}}};
      });
  for (const ExposureParameters& parameters : {ExposureParameters{}, Plain()}) {
    const Evidence before = Count(session, parameters);
    Session longer = session;
    longer.scans.push_back(session.scans[2]);
    longer.poses.push_back(session.poses[2]);
    const Evidence after = Count(longer, parameters);
    ASSERT_EQ(before.keys, after.keys);
    size_t hit = 0;
    for (size_t i = 0; i < before.keys.size(); ++i) {
      if (after.hits[i] == before.hits[i]) continue;
      ++hit;
      const auto r = [&](const Evidence& of) { return of.hits[i] / (of.hits[i] + of.exposures[i] + 1e-3); };
      ASSERT_GE(r(after), r(before));
    }
    EXPECT_GT(hit, 1000U);
  }
}

TEST(Exposure, WithoutSubVoxelsAScanThatHitsAVoxelNeverLowersItsR) {
  // Also where it hits a part of the voxel that was not hit before: 20 random scans are added to random sessions.
  std::mt19937 random(11);
  std::uniform_real_distribution<double> any(-4, 4);
  for (int round = 0; round < 20; ++round) {
    const auto add = [&](Session& session) {
      std::vector<Eigen::Vector3d> points(300);
      for (auto& point : points) point = {any(random), any(random), any(random) / 8};
      Add(session, At(any(random), any(random), 0.1), points);
    };
    Session session;
    for (int i = 0; i < 5; ++i) add(session);
    const Evidence before = Count(session, {.sub_voxels = false});
    add(session);
    const Evidence after = Count(session, {.sub_voxels = false});
    size_t hit = 0;
    for (size_t i = 0; i < before.keys.size(); ++i) {
      const size_t j = std::ranges::lower_bound(after.keys, before.keys[i]) - after.keys.begin();
      if (after.hits[j] == before.hits[i]) continue;
      ++hit;
      ASSERT_EQ(after.exposures[j], before.exposures[i]);
    }
    EXPECT_GT(hit, 0U);
  }
}

TEST(Exposure, BadInputIsNamed) {
  const auto message = [](const Session& session) {
    return std::string(CountEvidence(session.source(), session.poses, kVoxel, {}).status().message());
  };
  Session session;
  EXPECT_THAT(message(session), HasSubstr("no scans"));
  Add(session, At(0, 0, 0), {kNear});
  Add(session, At(0, 0, 0), {kNear, {0, 0, std::nan("")}});
  EXPECT_THAT(message(session), HasSubstr("scan 1: point 1: the point is not finite"));
  session.scans[1].points[1] = {3e5, 0, 0};
  EXPECT_THAT(message(session), HasSubstr("scan 1: point 1: point (300000.0, 0.0, 0.0) m lies beyond the map's range"));
  session.scans[1].points.clear();
  EXPECT_THAT(message(session), HasSubstr("scan 1: the scan has no points"));
  session.scans.pop_back();
  EXPECT_THAT(message(session), HasSubstr("2 poses for 1 scans"));
}

TEST(Exposure, TheFirstBadScanIsNamedOnAnyNumberOfThreads) {
  Session session;
  for (int i = 0; i < 50; ++i) Add(session, At(0, 0, 0), {kNear});
  session.scans[17].points.clear();
  session.scans[31].points.clear();
  for (const int threads : {1, 4}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    EXPECT_THAT(CountEvidence(session.source(), session.poses, kVoxel, {}).status().message(), HasSubstr("scan 17:"));
  }
}

}  // namespace
}  // namespace mapkeep
