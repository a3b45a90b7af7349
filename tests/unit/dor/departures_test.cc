#include "core/dor/departures.h"

#include <gtest/gtest.h>

#include <algorithm>
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

DorParameters WithoutDepartures() {
  DorParameters parameters;
  parameters.departures = false;
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
