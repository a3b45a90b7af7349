#include "core/registration/aligner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>

#include "tests/unit/registration/scene.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

std::vector<Pose> Moved(const Pose& motion, const std::vector<Pose>& poses) {
  std::vector<Pose> moved;
  for (const Pose& pose : poses) moved.push_back(motion * pose);
  return moved;
}

// The part of a target between two places along the street.
RegistrationTarget Within(const RegistrationTarget& target, double from, double to) {
  RegistrationTarget part{.voxel_size = target.voxel_size};
  for (size_t i = 0; i < target.points.size(); ++i) {
    if (target.points[i].x() < from || target.points[i].x() > to) continue;
    part.points.push_back(target.points[i]);
    part.normals.push_back(target.normals[i]);
  }
  return part;
}

int TrustedCount(const Alignment& alignment) {
  return static_cast<int>(std::ranges::count_if(alignment.windows, &WindowResult::trusted));
}

Alignment Aligned(const std::vector<Scan>& scans, const std::vector<Pose>& poses, const RegistrationTarget& target,
                  const AlignParameters& parameters = {}) {
  const auto alignment = AlignSession(SourceOf(scans), poses, MapOf(target), Pose::Identity(), parameters);
  EXPECT_TRUE(alignment.ok()) << alignment.status();
  return alignment.ok() ? *alignment : Alignment{};
}

TEST(AlignSession, AnOffsetOfHalfAMetreAndThreeDegreesIsRecovered) {
  const Scene street = StreetOf(-30, 60);
  const auto truth = DriveAlong(0, 30, 1);
  const auto alignment =
      Aligned(ScansOf(street, truth), Moved(MotionOf(3, {0.4, -0.25, 0.15}), truth), TargetOf(street));
  ASSERT_TRUE(alignment.accepted) << alignment.reason;
  EXPECT_EQ(TrustedCount(alignment), static_cast<int>(alignment.windows.size()));
  ExpectNear(alignment.poses, truth, 0.02, 0.1);
}

TEST(AlignSession, DriftIsTrackedFromWindowToWindow) {
  // 3 degrees over 75 m of odometry, which leads 2 m astray: little from one window to the next.
  const Scene street = StreetOf(-30, 105);
  const auto truth = DriveAlong(0, 75, 1.5);
  std::vector<Pose> drifted{truth[0]};
  for (size_t i = 1; i < truth.size(); ++i) {
    drifted.push_back(drifted.back() * truth[i - 1].inverse() * truth[i] * MotionOf(0.06, {0.005, 0, 0}));
  }
  ASSERT_GT((drifted.back().translation() - truth.back().translation()).norm(), 1.5);
  const auto alignment = Aligned(ScansOf(street, truth), drifted, TargetOf(street));
  ASSERT_TRUE(alignment.accepted) << alignment.reason;
  EXPECT_EQ(TrustedCount(alignment), static_cast<int>(alignment.windows.size()));
  ExpectNear(alignment.poses, truth, 0.1, 0.4);
}

TEST(AlignSession, ASessionFromElsewhereIsRefusedWithItsFiguresAndThresholds) {
  const auto truth = DriveAlong(0, 20, 1);
  // The session's street has no facades on the right, and fields with nothing in them on the left.
  const Scene elsewhere{{{-30, 20, 3}, {80, 0, 0}, {0, 20, 8}}, {{0, -20, 0}, {0, 10, 0}, {0, 0, 9}}};
  const auto alignment = Aligned(ScansOf(elsewhere, truth), truth, TargetOf(StreetOf(-30, 50)));
  EXPECT_FALSE(alignment.accepted);
  EXPECT_TRUE(alignment.poses.empty());
  EXPECT_EQ(TrustedCount(alignment), 0);
  EXPECT_GT(alignment.windows.size(), 1U);
  EXPECT_THAT(alignment.reason, HasSubstr("fitness 0."));
  EXPECT_THAT(alignment.reason, HasSubstr("at least 0.75 is needed"));
}

TEST(AlignSession, APartBeyondTheMapIsCarriedByTheNearestTrustedWindow) {
  const Scene street = StreetOf(-30, 120);
  const auto truth = DriveAlong(0, 90, 1.5);
  const Pose offset = MotionOf(1, {0.3, 0.2, 0});
  const auto alignment = Aligned(ScansOf(street, truth), Moved(offset, truth), Within(TargetOf(street), -30, 45));
  ASSERT_TRUE(alignment.accepted) << alignment.reason;
  EXPECT_TRUE(alignment.windows.front().trusted);
  EXPECT_FALSE(alignment.windows.back().trusted);
  ExpectNear(alignment.poses, truth, 0.1, 0.1);
}

TEST(AlignSession, ASessionThatEntersTheMapIsCarriedBackwards) {
  const Scene street = StreetOf(-30, 120);
  const auto truth = DriveAlong(0, 90, 1.5);
  const auto alignment =
      Aligned(ScansOf(street, truth), Moved(MotionOf(1, {0.3, 0.2, 0}), truth), Within(TargetOf(street), 48, 120));
  ASSERT_TRUE(alignment.accepted) << alignment.reason;
  EXPECT_FALSE(alignment.windows.front().trusted);
  EXPECT_TRUE(alignment.windows.back().trusted);
  ExpectNear(alignment.poses, truth, 0.1, 0.1);
}

TEST(AlignSession, ParkedCarsThatCameAndWentDoNotMoveIt) {
  Scene before = StreetOf(-30, 60), after = before;
  for (double x = -25; x < 55; x += 6) {
    before.push_back({{x, 5, 0.2}, {4, 0, 0}, {0, 0, 1.3}});
    after.push_back({{x + 1.5, 4.6, 0.2}, {4, 0, 0}, {0, 0, 1.3}});
  }
  const auto truth = DriveAlong(0, 30, 1);
  const auto alignment = Aligned(ScansOf(after, truth), Moved(MotionOf(1, {0.3, 0.2, 0.1}), truth), TargetOf(before));
  ASSERT_TRUE(alignment.accepted) << alignment.reason;
  ExpectNear(alignment.poses, truth, 0.03, 0.1);
}

TEST(AlignSession, AnEmptyCorridorAndABarePlaneAreRefused) {
  const auto truth = DriveAlong(0, 20, 1);
  const Scene corridor = CorridorOf(-40, 60), plane{corridor[0]};
  for (const Scene& scene : {corridor, plane}) {
    const auto alignment = Aligned(ScansOf(scene, truth), Moved(MotionOf(0, {0.3, 0.1, 0}), truth), TargetOf(scene));
    EXPECT_FALSE(alignment.accepted);
    EXPECT_THAT(alignment.reason, HasSubstr("observability"));
  }
}

TEST(AlignSession, DegenerateScansAreRefusedOrAlignedButNeverCrash) {
  const RegistrationTarget target = TargetOf(StreetOf(-30, 40));
  const auto still = std::vector<Pose>(12, DriveAlong(5, 5, 1)[0]);
  const float nan = std::numeric_limits<float>::quiet_NaN();

  const auto one_point = Aligned(std::vector<Scan>(12, Scan{.points = {{1, 2, -1}}}), still, target);
  EXPECT_FALSE(one_point.accepted);
  const auto all_nan = Aligned(std::vector<Scan>(12, Scan{.points = {{nan, nan, nan}}}), still, target);
  EXPECT_FALSE(all_nan.accepted);
  const auto one_place =
      Aligned(std::vector<Scan>(12, Scan{.points = std::vector(5000, Eigen::Vector3f(3, 0, 0))}), still, target);
  EXPECT_FALSE(one_place.accepted);
  const auto far =
      Aligned(std::vector<Scan>(12, Scan{.points = std::vector(500, Eigen::Vector3f(1e30F, 0, 0))}), still, target);
  EXPECT_FALSE(far.accepted);
}

TEST(AlignSession, IdenticalScansOfARobotThatStandsAreAligned) {
  const Scene street = StreetOf(-30, 60);
  const auto truth = std::vector<Pose>(40, DriveAlong(5, 5, 1)[0]);
  const std::vector<Scan> scans(40, ScansOf(street, {truth[0]})[0]);
  const auto alignment = Aligned(scans, Moved(MotionOf(1, {0.3, 0.2, 0.1}), truth), TargetOf(street));
  ASSERT_TRUE(alignment.accepted) << alignment.reason;
  ExpectNear(alignment.poses, truth, 0.03, 0.15);
}

TEST(AlignSession, WithoutScansOrMapItIsRefused) {
  EXPECT_THAT(Aligned({}, {}, TargetOf(StreetOf(0, 9))).reason, HasSubstr("no scans"));
  const auto poses = DriveAlong(0, 3, 1);
  const auto nothing = Aligned(ScansOf(StreetOf(-9, 9), poses), poses, {});
  EXPECT_FALSE(nothing.accepted);
  EXPECT_THAT(nothing.reason, HasSubstr("nothing static"));
}

TEST(AlignSession, TheSameOnAnyNumberOfThreads) {
  const Scene street = StreetOf(-30, 50);
  const auto truth = DriveAlong(0, 20, 1);
  const auto scans = ScansOf(street, truth);
  const auto given = Moved(MotionOf(1, {0.3, 0.2, 0.1}), truth);
  const RegistrationTarget target = TargetOf(street);
  std::vector<Alignment> alignments;
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    alignments.push_back(arena.execute([&] { return Aligned(scans, given, target); }));
  }
  for (const Alignment& alignment : alignments) {
    ASSERT_TRUE(alignment.accepted);
    for (size_t i = 0; i < truth.size(); ++i) {
      ASSERT_EQ(RowsOf(alignment.poses[i]), RowsOf(alignments[0].poses[i])) << "scan " << i;
    }
  }
}

TEST(AlignSession, PassesErrorsOnAndStopsWhenTold) {
  const Scene street = StreetOf(-30, 50);
  const auto poses = DriveAlong(0, 20, 1);
  const RegistrationTarget target = TargetOf(street);
  ScanSource source = SourceOf(ScansOf(street, poses));
  std::vector<double> heard;
  ASSERT_TRUE(AlignSession(source, poses, MapOf(target), Pose::Identity(), {}, [&](double f) {
                return heard.push_back(f), true;
              }).ok());
  EXPECT_TRUE(std::ranges::is_sorted(heard));
  EXPECT_DOUBLE_EQ(heard.back(), 1);
  EXPECT_TRUE(absl::IsCancelled(
      AlignSession(source, poses, MapOf(target), Pose::Identity(), {}, [](double) { return false; }).status()));

  const auto fewer = std::vector<Pose>(poses.begin(), poses.end() - 1);
  EXPECT_THAT(AlignSession(source, fewer, MapOf(target), Pose::Identity(), {}).status().ToString(),
              HasSubstr("21 scans but 20 poses"));
  EXPECT_THAT(AlignSession(source, poses, MapOf(target), Pose::Identity(), {.source_voxel = 0}).status().ToString(),
              HasSubstr("source_voxel is 0 m"));
  source.read = [](size_t index) -> absl::StatusOr<Scan> {
    if (index >= 4) return absl::DataLossError("scan " + std::to_string(index) + " is torn");
    return Scan{.points = {{1, 1, 1}}};
  };
  const auto torn = AlignSession(source, poses, MapOf(target), Pose::Identity(), {});
  EXPECT_TRUE(absl::IsDataLoss(torn.status()));
  EXPECT_THAT(torn.status().ToString(), HasSubstr("scan 4 is torn"));
}

}  // namespace
}  // namespace mapkeep
