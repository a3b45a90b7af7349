// Sessions that nobody knows the place of.

#include "core/registration/session_search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numbers>

#include "core/registration/aligner.h"
#include "core/registration/surface_normals.h"
#include "core/registration/thinning.h"
#include "tests/unit/registration/scene.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

// Search from above alone: what these tests are about, and the faster half.
AlignParameters FromAbove() {
  AlignParameters parameters;
  parameters.match_descriptors = false;
  return parameters;
}

std::vector<Pose> Moved(const Pose& motion, const std::vector<Pose>& poses) {
  std::vector<Pose> moved;
  for (const Pose& pose : poses) moved.push_back(motion * pose);
  return moved;
}

Alignment Found(const Scene& scene, const std::vector<Pose>& truth, const Pose& frame, const RegistrationTarget& target,
                const std::optional<PositionPrior>& position = {}) {
  const auto alignment =
      AlignSession(SourceOf(ScansOf(scene, truth)), Moved(frame, truth), MapOf(target), {}, FromAbove(), {}, position);
  EXPECT_TRUE(alignment.ok()) << alignment.status();
  return alignment.ok() ? *alignment : Alignment{};
}

TEST(SessionSearch, AnyFrameIsFoundByItself) {
  const Scene street = VariedStreetOf(-30, 75);
  const RegistrationTarget map = FacingStreet(TargetOf(street));
  const auto truth = DriveAlong(0, 40, 1.5);
  for (const double yaw : {0.0, 100.0, 200.0}) {
    const Alignment alignment = Found(street, truth, MotionOf(yaw, {-140, 85, 12}), map);
    ASSERT_TRUE(alignment.accepted) << alignment.reason;
    ExpectNear(alignment.poses, truth, 0.03, 0.1);
  }
}

TEST(SessionSearch, AStreetWhoseBlocksAreCopiesIsRefusedUntilGnssSaysWhich) {
  // Two blocks of 60 m, the second a copy of the first, with open ends far from the drive.
  Scene copies = VariedStreetOf(0, 60);
  for (const Rectangle& rectangle : VariedStreetOf(0, 60)) {
    Rectangle copy = rectangle;
    copy.corner.x() += 150;
    copies.push_back(copy);
  }
  const RegistrationTarget map = FacingStreet(TargetOf(copies));
  const auto truth = DriveAlong(15, 45, 1.5);
  const Pose frame = MotionOf(50, {300, 20, 1});
  const Alignment either = Found(copies, truth, frame, map);
  EXPECT_FALSE(either.accepted);
  EXPECT_THAT(either.reason, HasSubstr("two places fit it"));

  PositionPrior gnss{.position = truth.front().translation() + Eigen::Vector3d(4, -3, 2),
                     .covariance = Eigen::Vector3d(9, 9, 25).asDiagonal()};
  const Alignment first = Found(copies, truth, frame, map, gnss);
  ASSERT_TRUE(first.accepted) << first.reason;
  ExpectNear(first.poses, truth, 0.03, 0.1);

  gnss.position.x() += 150;
  const Alignment second = Found(copies, truth, frame, map, gnss);
  ASSERT_TRUE(second.accepted) << second.reason;
  ExpectNear(second.poses, Moved(MotionOf(0, {150, 0, 0}), truth), 0.03, 0.1);
}

TEST(SessionSearch, APlaceFarFromItsGnssPositionIsRefused) {
  const Scene street = VariedStreetOf(-30, 75);
  const RegistrationTarget map = FacingStreet(TargetOf(street));
  const auto truth = DriveAlong(0, 30, 1.5);
  // The poses fit as they are; GNSS has the robot 40 m aside.
  const PositionPrior gnss{.position = truth.front().translation() + Eigen::Vector3d(0, 40, 0),
                           .covariance = 4 * Eigen::Matrix3d::Identity()};
  const Alignment alignment = Found(street, truth, Pose::Identity(), map, gnss);
  EXPECT_FALSE(alignment.accepted);
  EXPECT_TRUE(alignment.poses.empty());
  EXPECT_THAT(alignment.reason, HasSubstr("from where GNSS has it"));
}

TEST(SessionSearch, AnInitialPoseFarAlongTheStreetIsNotBelieved) {
  const Scene street = VariedStreetOf(-40, 75);
  const RegistrationTarget map = FacingStreet(TargetOf(street));
  const auto truth = DriveAlong(0, 25, 1.5);
  for (const double off : {-17.0, 6.0, 17.0}) {
    const auto alignment =
        AlignSession(SourceOf(ScansOf(street, truth)), truth, MapOf(map), MotionOf(0, {off, 0, 0}), FromAbove());
    ASSERT_TRUE(alignment.ok()) << alignment.status();
    ASSERT_TRUE(alignment->accepted) << off << " m off: " << alignment->reason;
    ExpectNear(alignment->poses, truth, 0.03, 0.1);
  }
}

TEST(SessionSearch, DegenerateSessionsAreRefusedWithAReason) {
  const RegistrationTarget map = FacingStreet(TargetOf(VariedStreetOf(-30, 50)));
  const auto drive = DriveAlong(0, 20, 2);
  const std::vector<Pose> still(drive.size(), drive[0]);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const Scene corridor = CorridorOf(-40, 60), plane{corridor[0]};
  const auto filled = [&](const Scan& scan) { return std::vector<Scan>(drive.size(), scan); };
  const struct {
    const char* what;
    std::vector<Scan> scans;
    std::vector<Pose> poses;
  } cases[] = {
      {"an empty corridor", ScansOf(corridor, drive), drive},
      {"a plane", ScansOf(plane, drive), drive},
      {"one point", filled({.points = {{1, 2, -1}}}), drive},
      {"all NaN", filled({.points = std::vector(50, Eigen::Vector3f(nan, nan, nan))}), drive},
      {"one place many times", filled({.points = std::vector(3000, Eigen::Vector3f(3, 0, 0))}), still},
      {"a standing robot in nothing but a wall", ScansOf({{{-5, 4, 0}, {10, 0, 0}, {0, 0, 3}}}, still), still}};
  for (const auto& [what, scans, poses] : cases) {
    const auto alignment = AlignSession(SourceOf(scans), Moved(MotionOf(70, {200, 0, 0}), poses), MapOf(map), {}, {});
    ASSERT_TRUE(alignment.ok()) << what << ": " << alignment.status();
    EXPECT_FALSE(alignment->accepted) << what;
    EXPECT_FALSE(alignment->reason.empty()) << what;
    EXPECT_TRUE(alignment->poses.empty()) << what;
  }
}

// What a session adds to the map: its points where it lies, a point a voxel, with normals towards its sensors.
void Extend(RegistrationTarget& map, const std::vector<Scan>& scans, const std::vector<Pose>& poses) {
  FacingPoints all{map.points, map.normals};
  for (size_t i = 0; i < scans.size(); ++i) {
    FacingPoints scan;
    for (const Eigen::Vector3f& point : scans[i].points) {
      scan.points.push_back(poses[i] * point.cast<double>());
      scan.facing.emplace_back((poses[i].translation() - scan.points.back()).normalized());
    }
    scan = ThinPoints(scan, map.voxel_size);
    all.points.insert(all.points.end(), scan.points.begin(), scan.points.end());
    all.facing.insert(all.facing.end(), scan.facing.begin(), scan.facing.end());
  }
  all = ThinPoints(all, map.voxel_size);
  const PointTree tree(all.points);
  const auto surfaces = SurfaceNormalsAt(all.points, all.points, tree);
  map.points = all.points;
  map.normals.clear();
  for (size_t i = 0; i < all.points.size(); ++i) {
    map.normals.emplace_back(surfaces[i].normal.dot(all.facing[i]) < 0 ? Eigen::Vector3d(-surfaces[i].normal)
                                                                       : surfaces[i].normal);
  }
}

TEST(SessionSearch, FourRobotsInAnyOrderMakeOneConsistentMap) {
  const Scene street = VariedStreetOf(-30, 110);
  // Each drives a part of the street, in a frame of its own; neighbours share 20 m.
  const std::vector<std::vector<Pose>> truths{DriveAlong(0, 36, 2), DriveAlong(16, 52, 2), DriveAlong(32, 68, 2),
                                              DriveAlong(48, 84, 2)};
  std::vector<std::vector<Scan>> scans;
  for (const auto& truth : truths) scans.push_back(ScansOf(street, truth));
  for (const std::vector<size_t>& order : {std::vector<size_t>{0, 1, 2, 3}, {3, 2, 1, 0}, {2, 0, 3, 1}, {0, 3, 1, 2}}) {
    RegistrationTarget map{.voxel_size = 0.2};
    std::vector<std::vector<Pose>> placed(truths.size());
    std::vector<size_t> waiting = order;
    // As the daemon does: what is refused is tried again whenever another one came in.
    for (size_t round = 0; round < order.size() && !waiting.empty(); ++round) {
      std::vector<size_t> refused;
      for (const size_t robot : waiting) {
        const auto own = Moved(truths[robot].front().inverse(), truths[robot]);
        if (map.points.empty()) {
          placed[robot] = own;
        } else {
          const auto alignment = AlignSession(SourceOf(scans[robot]), own, MapOf(map), {}, FromAbove());
          ASSERT_TRUE(alignment.ok()) << alignment.status();
          if (!alignment->accepted) {
            refused.push_back(robot);
            continue;
          }
          placed[robot] = alignment->poses;
        }
        Extend(map, scans[robot], placed[robot]);
      }
      waiting = refused;
    }
    ASSERT_TRUE(waiting.empty()) << waiting.size() << " robots never found their place, the first came " << order[0];
    const Pose to_street = truths[order[0]].front() * placed[order[0]].front().inverse();
    for (size_t robot = 0; robot < truths.size(); ++robot) {
      ExpectNear(Moved(to_street, placed[robot]), truths[robot], 0.12, 0.4);
    }
  }
}

TEST(PositionPrior, SaysHowFarOffAPlaceIs) {
  const PositionPrior prior{.position = {10, 0, 0}, .covariance = Eigen::Vector3d(4, 4, 9).asDiagonal()};
  EXPECT_NEAR(DeviationsFrom(prior, {14, 0, 0}, 0), 2, 1e-9);
  EXPECT_NEAR(DeviationsFrom(prior, {10, 0, 9}, 0), 3, 1e-9);
  EXPECT_NEAR(DeviationsFrom(prior, {15, 0, 0}, 1.5), 2, 1e-9) << "4 and 1.5^2 square metres";
  EXPECT_NEAR(ReachOf(prior), 12, 1e-9) << "four times the largest deviation";
}

TEST(PositionPrior, ACovarianceIsFiniteSymmetricAndPositive) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  EXPECT_TRUE(IsCovariance(matrix));
  matrix(0, 1) = 0.5;
  EXPECT_FALSE(IsCovariance(matrix)) << "not symmetric";
  matrix(1, 0) = 0.5;
  EXPECT_TRUE(IsCovariance(matrix));
  matrix(2, 2) = 0;
  EXPECT_FALSE(IsCovariance(matrix)) << "a direction is known without error";
  matrix(2, 2) = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(IsCovariance(matrix));
}

}  // namespace
}  // namespace mapkeep
