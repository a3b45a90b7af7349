#include "core/dor/pose_refinement.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <random>

#include "tests/unit/dor/scenes.h"

namespace mapkeep {
namespace {

constexpr int kScans = 20;

// A robot drives along a wall, past boxes, over level ground.
Session Street() {
  return Drive(
      kScans, [](int i) { return At(0.4 * i, 0, 1.7); },
      [](int) {
        return World{.boxes = {{{-30, 8, 0}, {30, 8.4, 4}}, {{2, -6, 0}, {6, -4, 1.6}}, {{12, -9, 0}, {12.5, 6, 3}}}};
      },
      48, 720);
}

std::vector<Pose> Disturbed(const std::vector<Pose>& poses, double metres, double radians) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::vector<Pose> disturbed = poses;
  for (Pose& pose : disturbed) {
    const Eigen::Vector3d axis(normal(random), normal(random), normal(random));
    pose.translation() += metres * Eigen::Vector3d(normal(random), normal(random), normal(random));
    pose.linear() = Eigen::AngleAxisd(radians * axis.norm(), axis.normalized()) * pose.linear();
  }
  return disturbed;
}

double RmsMetres(const std::vector<Pose>& poses, const std::vector<Pose>& truth) {
  double sum = 0;
  for (size_t i = 0; i < poses.size(); ++i) sum += (poses[i].translation() - truth[i].translation()).squaredNorm();
  return std::sqrt(sum / static_cast<double>(poses.size()));
}

std::vector<Pose> Refined(const Session& session, const std::vector<Pose>& poses) {
  const auto refined = RefinePoses(session.source(), poses, {});
  EXPECT_TRUE(refined.ok()) << refined.status();
  return *refined;
}

TEST(PoseRefinement, NoiseFromScanToScanIsTakenOut) {
  const Session session = Street();
  const std::vector<Pose> noisy = Disturbed(session.poses, 0.03, 0.002);
  EXPECT_LT(RmsMetres(Refined(session, noisy), session.poses), RmsMetres(noisy, session.poses) / 2);
}

TEST(PoseRefinement, GoodPosesStayAsTheyAre) {
  const Session session = Street();
  const std::vector<Pose> refined = Refined(session, session.poses);
  for (size_t i = 0; i < refined.size(); ++i) EXPECT_EQ(refined[i].matrix(), session.poses[i].matrix()) << i;
}

TEST(PoseRefinement, AScanThatWouldMoveTooFarKeepsItsPose) {
  const Session session = Street();
  const std::vector<Pose> noisy = Disturbed(session.poses, 0.03, 0.002);
  const auto refined = RefinePoses(session.source(), noisy, {.max_correction = 0.002});
  ASSERT_TRUE(refined.ok()) << refined.status();
  for (size_t i = 0; i < noisy.size(); ++i) EXPECT_EQ((*refined)[i].matrix(), noisy[i].matrix()) << i;
}

TEST(PoseRefinement, ThePosesDoNotDependOnTheNumberOfThreads) {
  const Session session = Street();
  const std::vector<Pose> noisy = Disturbed(session.poses, 0.03, 0.002);
  const auto with = [&](size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return Refined(session, noisy);
  };
  const std::vector<Pose> one = with(1), two = with(2);
  for (size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i].matrix(), two[i].matrix()) << i;
}

TEST(PoseRefinement, ASurfaceThatLeavesADirectionOpenLeavesItAsGiven) {
  Session session;  // a bare plane below: nothing says where along it a scan lies
  for (int i = 0; i < 10; ++i) {
    std::vector<Eigen::Vector3d> points;
    for (int x = -40; x < 40; ++x) {
      for (int y = -40; y < 40; ++y) points.emplace_back(0.25 * x, 0.25 * y, 0);
    }
    Add(session, At(0, 0, 1.7), points);
  }
  const std::vector<Pose> noisy = Disturbed(session.poses, 0.05, 0);
  const std::vector<Pose> refined = Refined(session, noisy);
  for (size_t i = 0; i < refined.size(); ++i) {
    EXPECT_NEAR(refined[i].translation().x(), noisy[i].translation().x(), 0.02);
    EXPECT_NEAR(refined[i].translation().y(), noisy[i].translation().y(), 0.02);
  }
}

}  // namespace
}  // namespace mapkeep
