#include "core/ratio_map/session_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <bit>
#include <map>
#include <random>

#include "core/voxels/normal.h"

namespace mapkeep {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kEdge = 0.2;

/// A session whose every scan is given in the map frame, seen from a sensor at a place.
struct Session {
  std::vector<Scan> scans;
  std::vector<Pose> poses;
  std::vector<std::vector<PointLabel>> labels;

  void AddScan(const Eigen::Vector3d& sensor, const std::vector<Eigen::Vector3d>& points,
               std::vector<PointLabel> point_labels = {}) {
    Scan scan;
    for (const Eigen::Vector3d& point : points) scan.points.push_back((point - sensor).cast<float>());
    scan.intensities.assign(points.size(), 0.5F);
    scans.push_back(std::move(scan));
    poses.emplace_back(Eigen::Translation3d(sensor));
    point_labels.resize(points.size(), PointLabel::kStatic);
    labels.push_back(std::move(point_labels));
  }

  Labeller labeller() const {
    return [this](size_t index, const Scan&) { return labels[index]; };
  }

  /// Hits of every voxel with a point; exposures as given.
  Evidence EvidenceWith(const std::map<VoxelKey, uint32_t>& exposures = {}) const {
    std::map<VoxelKey, std::pair<uint32_t, uint32_t>> counts;
    for (const auto& [key, count] : exposures) counts[key].second = count;
    for (size_t i = 0; i < scans.size(); ++i) {
      std::vector<VoxelKey> keys;
      for (const Eigen::Vector3f& point : scans[i].points) {
        keys.push_back(VoxelKeyOf(*VoxelIndexOf(poses[i] * point.cast<double>(), kEdge)));
      }
      std::ranges::sort(keys);
      keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
      for (const VoxelKey key : keys) ++counts[key].first;
    }
    Evidence evidence{.voxel_size = kEdge};
    for (const auto& [key, count] : counts) {
      evidence.keys.push_back(key);
      evidence.hits.push_back(count.first);
      evidence.exposures.push_back(count.second);
    }
    return evidence;
  }

  absl::StatusOr<SessionMap> Build(const Evidence& evidence, const SessionMapParameters& parameters = {},
                                   const Progress& progress = {}) const {
    return BuildSessionMap(SourceOf(scans), poses, labeller(), evidence, 42, parameters, progress);
  }
};

VoxelKey KeyAt(double x, double y, double z) { return VoxelKeyOf(*VoxelIndexOf(Eigen::Vector3d(x, y, z), kEdge)); }

const SessionVoxel& At(const SessionMap& map, VoxelKey key) {
  static const SessionVoxel kNone;
  const auto found = std::ranges::find(map.voxels, key, &SessionVoxel::key);
  EXPECT_NE(found, map.voxels.end());
  return found == map.voxels.end() ? kNone : *found;
}

constexpr PointLabel kStatic = PointLabel::kStatic, kGround = PointLabel::kGround, kDynamic = PointLabel::kDynamic;

TEST(SessionMap, HitsAreScansNotPoints) {
  Session session;
  session.AddScan({5, 5, 1}, {{0.05, 0.05, 0.05}, {0.10, 0.10, 0.10}, {0.15, 0.15, 0.15}});
  session.AddScan({6, 5, 1}, {{0.05, 0.05, 0.05}});
  session.AddScan({7, 5, 1}, {{1.05, 0.05, 0.05}});
  const auto map = session.Build(session.EvidenceWith({{KeyAt(0.1, 0.1, 0.1), 1}}));
  ASSERT_TRUE(map.ok()) << map.status();
  const SessionVoxel& voxel = At(*map, KeyAt(0.1, 0.1, 0.1));
  EXPECT_EQ(voxel.hits, 2U);
  EXPECT_EQ(voxel.exposures, 1U);
  EXPECT_EQ(map->voxels.size(), 2U);
  EXPECT_EQ(map->start_minutes, 42U);
  EXPECT_DOUBLE_EQ(map->voxel_size, kEdge);
}

TEST(SessionMap, RemovedPointsAddNoHitButTheExposuresOfTheirVoxelCount) {
  Session session;
  const Eigen::Vector3d car(0.1, 0.1, 0.1), wall(3.1, 0.1, 0.1);
  session.AddScan({5, 5, 1}, {car, wall}, {kDynamic, kStatic});
  session.AddScan({5, 5, 1}, {car, wall}, {kDynamic, kDynamic});
  session.AddScan({5, 5, 1}, {wall});
  const auto map = session.Build(session.EvidenceWith({{KeyAt(0.1, 0.1, 0.1), 1}}));
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_EQ(At(*map, KeyAt(0.1, 0.1, 0.1)),
            (SessionVoxel{.key = KeyAt(0.1, 0.1, 0.1), .hits = 0, .exposures = 1, .was_removed = true}));
  EXPECT_EQ(At(*map, KeyAt(3.1, 0.1, 0.1)).hits, 2U);
}

TEST(SessionMap, WatchedVoxelsCarryTheirExposuresAndSilentOnesAreLeftOut) {
  Session session;
  session.AddScan({5, 5, 1}, {{0.1, 0.1, 0.1}});
  const auto map = session.Build(session.EvidenceWith({{KeyAt(2.1, 0.1, 0.1), 9}, {KeyAt(4.1, 0.1, 0.1), 0}}));
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_EQ(map->voxels.size(), 2U);
  EXPECT_EQ(At(*map, KeyAt(2.1, 0.1, 0.1)).exposures, 9U);
}

TEST(SessionMap, TheFieldsComeFromTheKeptPoints) {
  Session session;
  // The kept points lie at 0.3 and 0.7 of the edge, in the sub-voxels 1 and 2; the removed one in a corner of its own.
  session.AddScan({0.1, 0.1, 9}, {{0.06, 0.06, 0.06}, {0.14, 0.14, 0.14}, {0.19, 0.01, 0.01}},
                  {kGround, kGround, kDynamic});
  const auto map = session.Build(session.EvidenceWith());
  ASSERT_TRUE(map.ok()) << map.status();
  const SessionVoxel& voxel = At(*map, KeyAt(0.1, 0.1, 0.1));
  EXPECT_TRUE(voxel.ground);
  for (const uint8_t axis : voxel.mean) EXPECT_NEAR(axis, 127.5, 0.6);
  EXPECT_EQ(voxel.mask, uint64_t{1} << (1 + 4 + 16) | uint64_t{1} << (2 + 8 + 32));
  EXPECT_NEAR(voxel.intensity, 127.5, 0.6);
}

TEST(SessionMap, GroundIsTheVerdictOfMostScans) {
  Session session;
  const Eigen::Vector3d point(0.1, 0.1, 0.1);
  session.AddScan({5, 5, 1}, {point}, {kGround});
  session.AddScan({5, 5, 1}, {point}, {kGround});
  session.AddScan({5, 5, 1}, {point}, {kStatic});
  EXPECT_TRUE(session.Build(session.EvidenceWith())->voxels[0].ground);
  session.AddScan({5, 5, 1}, {point}, {kStatic});
  EXPECT_FALSE(session.Build(session.EvidenceWith())->voxels[0].ground);
}

TEST(SessionMap, NormalsStandOnTheWallAndPointToWhereItWasSeenFrom) {
  for (const double side : {-4.0, 4.0}) {
    Session session;
    std::vector<Eigen::Vector3d> wall;
    const Eigen::Vector3d across = Eigen::Vector3d(1, 0.3, 0).normalized(), along(-across.y(), across.x(), 0);
    for (double s = -3; s < 3; s += 0.04) {
      for (double z = 0; z < 3; z += 0.06) wall.emplace_back(s * along + z * Eigen::Vector3d::UnitZ());
    }
    session.AddScan(side * across, wall);
    const auto map = session.Build(session.EvidenceWith());
    ASSERT_TRUE(map.ok()) << map.status();
    int wrong = 0;
    for (const SessionVoxel& voxel : map->voxels) {
      const double cosine = DecodeNormal(voxel.normal).dot(across) * (side > 0 ? 1 : -1);
      wrong += cosine < std::cos(0.1) ? 1 : 0;
    }
    EXPECT_LE(wrong, static_cast<int>(map->voxels.size() / 100)) << "of " << map->voxels.size();
  }
}

TEST(SessionMap, AWireHasNoNormal) {
  Session session;
  std::vector<Eigen::Vector3d> wire;
  for (double x = 0; x < 3; x += 0.02) wire.emplace_back(x, 0.1, 0.1);
  session.AddScan({1, 1, 5}, wire);
  const auto map = session.Build(session.EvidenceWith());
  ASSERT_TRUE(map.ok()) << map.status();
  for (const SessionVoxel& voxel : map->voxels) EXPECT_THAT(voxel.normal, ElementsAre(0, 0));
}

TEST(SessionMap, TheMaximumIsAPercentileOfTheHitVoxels) {
  Session session;
  std::vector<Eigen::Vector3d> points;
  std::map<VoxelKey, uint32_t> exposures;
  for (int i = 0; i < 100; ++i) {
    points.emplace_back(0.2 * i + 0.1, 0.1, 0.1);
    exposures[KeyAt(0.2 * i + 0.1, 0.1, 0.1)] = i;  // N_S = 1 + i: 1 to 100
  }
  exposures[KeyAt(0.1, 9.1, 0.1)] = 5000;  // never hit: does not count
  session.AddScan({0, 0, 5}, points);
  const Evidence evidence = session.EvidenceWith(exposures);
  EXPECT_DOUBLE_EQ(session.Build(evidence)->n_max, 99);
  EXPECT_DOUBLE_EQ(session.Build(evidence, {.n_max_percentile = 100})->n_max, 100);
  EXPECT_DOUBLE_EQ(session.Build(evidence, {.n_max_percentile = 50})->n_max, 50);
}

TEST(SessionMap, TheSameOnAnyNumberOfThreads) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-6, 6);
  Session session;
  for (int i = 0; i < 40; ++i) {
    std::vector<Eigen::Vector3d> points;
    std::vector<PointLabel> labels;
    for (int p = 0; p < 2000; ++p) {
      points.emplace_back(any(random), any(random), any(random) / 6);
      labels.push_back(static_cast<PointLabel>(random() % 3));
    }
    session.AddScan({any(random), any(random), 1}, points, labels);
  }
  const Evidence evidence = session.EvidenceWith();
  std::vector<SessionMap> maps;
  for (const int threads : {1, 2, 5}) {
    tbb::task_arena arena(threads);
    maps.push_back(*arena.execute([&] { return session.Build(evidence); }));
  }
  for (const SessionMap& map : maps) {
    EXPECT_GT(map.voxels.size(), 1000U);
    EXPECT_EQ(map.voxels, maps[0].voxels);
    EXPECT_EQ(map.n_max, maps[0].n_max);
  }
}

TEST(SessionMap, ProgressRisesToOneAndCanStopTheWork) {
  Session session;
  for (int i = 0; i < 30; ++i) session.AddScan({5, 5, 1}, {{0.1, 0.1, 0.1}});
  std::vector<double> heard;
  ASSERT_TRUE(session.Build(session.EvidenceWith(), {}, [&](double f) { return heard.push_back(f), true; }).ok());
  EXPECT_EQ(heard.size(), 30U);
  EXPECT_TRUE(std::ranges::is_sorted(heard));
  EXPECT_DOUBLE_EQ(heard.back(), 1);
  const auto stopped = session.Build(session.EvidenceWith(), {}, [](double f) { return f < 0.5; });
  EXPECT_TRUE(absl::IsCancelled(stopped.status())) << stopped.status();
}

TEST(SessionMap, SaysWhatIsWrongWithItsInput) {
  Session session;
  for (int i = 0; i < 3; ++i) session.AddScan({5, 5, 1}, {{0.1, 0.1, 0.1}});
  const Evidence evidence = session.EvidenceWith();

  Session fewer_poses = session;
  fewer_poses.poses.pop_back();
  EXPECT_THAT(fewer_poses.Build(evidence).status().ToString(), HasSubstr("3 scans but 2 poses"));

  Session moved = session;
  moved.poses[1].translation().x() += 3;
  const absl::Status elsewhere = moved.Build(evidence).status();
  EXPECT_TRUE(absl::IsInvalidArgument(elsewhere));
  EXPECT_THAT(elsewhere.ToString(), HasSubstr("scan 1: a kept point lies in voxel (15, 0, 0)"));

  Session unreadable = session;
  ScanSource source = SourceOf(unreadable.scans);
  source.read = [](size_t index) -> absl::StatusOr<Scan> {
    if (index == 2) return absl::DataLossError("scan 2 is torn");
    return Scan{.points = {{-4.9F, -4.9F, -0.9F}}};
  };
  const auto torn = BuildSessionMap(source, session.poses, session.labeller(), evidence, 0, {});
  EXPECT_TRUE(absl::IsDataLoss(torn.status())) << torn.status();
}

TEST(SessionMap, NoScansMakeAnEmptyMap) {
  const auto map = Session().Build(Evidence{.voxel_size = kEdge});
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_TRUE(map->voxels.empty());
}

}  // namespace
}  // namespace mapkeep
