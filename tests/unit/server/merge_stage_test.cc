#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>

#include "server/pipeline/outline.h"
#include "server/pipeline/stages.h"
#include "storage/map_store.h"
#include "storage/rocksdb_engine.h"

namespace mapkeep {
namespace {

constexpr double kVoxelSize = 0.2;
constexpr int kScans = 4;

// A wall at x = 8 m, seen from x = 0 by a robot that drives along it.
Scan Wall() {
  Scan scan;
  for (int y = -20; y <= 20; ++y) {
    for (int z = 0; z <= 10; ++z) scan.points.emplace_back(8.05F, 0.1F * y, 0.1F * z);
  }
  return scan;
}

// A store with map "m": epoch 0 is empty, epoch 1 holds a column of voxels in front of the wall.
class MergeStage : public ::testing::Test {
 protected:
  MergeStage() {
    std::filesystem::remove_all(directory_);
    engine_ = *OpenRocksDbEngine(directory_);
    maps_ = OpenMapStore(*engine_, {});
    EXPECT_TRUE(maps_->Create({.name = "m", .voxel_size = kVoxelSize}).ok());
    empty_ = *maps_->Open("m");
    for (int z = 0; z < 5; ++z) column_.push_back(VoxelKeyOf(VoxelIndex{20, 0, z}));
    CommitRequest request{.session = "between"};
    request.blocks = [this](const Snapshot&) -> absl::StatusOr<std::vector<Block>> {
      Block block{.key = BlockKeyOf(column_[0])};
      for (const VoxelKey key : column_) {
        block.voxels.push_back({.position = PositionInBlock(key), .hits = 80, .is_static = true, .mask = 1});
      }
      return std::vector<Block>{block};
    };
    EXPECT_TRUE(maps_->Commit("m", request).ok());
    head_ = *maps_->Open("m");

    for (int i = 0; i < kScans; ++i) {
      scans_.push_back(Wall());
      Pose pose = Pose::Identity();
      pose.translation() << 0, 0.3 * i, 0.5;
      poses_.push_back(pose);
      outline_.extents.emplace_back(Eigen::Vector3d(0, -2, 0), Eigen::Vector3d(8.1, 2, 1));
    }
  }

  ~MergeStage() override {
    empty_.reset();
    head_.reset();
    maps_.reset();
    engine_.reset();
    std::filesystem::remove_all(directory_);
  }

  // The session merged into the head, after it was cleaned against `base`.
  MergeResult Merged(const Snapshot& base) {
    const ScanSource source = SourceOf(scans_);
    const auto removal = CleanAgainstMap(base, source, outline_, poses_, {}, {});
    EXPECT_TRUE(removal.ok()) << removal.status();
    const auto session = SummariseSession(source, poses_, *removal, 0, {}, {});
    EXPECT_TRUE(session.ok()) << session.status();
    const std::vector<BlockRange> reach = ReachOf(outline_, poses_, kVoxelSize, 0);
    auto result = MergeIntoMap(*head_, {base, *session, source, poses_, reach, {}}, {}, {}, {});
    EXPECT_TRUE(result.ok()) << result.status();
    return *std::move(result);
  }

  // One a test: ctest runs them side by side.
  const std::string directory_ = ::testing::TempDir() + ::testing::UnitTest::GetInstance()->current_test_info()->name();
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<MapStore> maps_;
  std::unique_ptr<Snapshot> empty_, head_;
  std::vector<VoxelKey> column_;
  std::vector<Scan> scans_;
  std::vector<Pose> poses_;
  SessionOutline outline_;
};

TEST_F(MergeStage, WhatTheSessionSeesThroughIsForgotten) {
  const MergeResult merged = Merged(*head_);
  const auto block = std::ranges::find(merged.changed, BlockKeyOf(column_[0]), &Block::key);
  ASSERT_NE(block, merged.changed.end());
  const auto stays = [&](VoxelKey key) {
    return std::ranges::count(block->voxels, PositionInBlock(key), &Voxel::position) == 1;
  };
  EXPECT_LT(std::ranges::count_if(column_, stays), 5);
}

TEST_F(MergeStage, ACommitThatCameBetweenIsSeenThroughAsIfItHadBeenThereBefore) {
  const MergeResult known = Merged(*head_);
  const MergeResult recounted = Merged(*empty_);
  EXPECT_EQ(recounted.changed, known.changed);
  EXPECT_EQ(recounted.static_voxels, known.static_voxels);
}

TEST_F(MergeStage, BlocksThatStayTheSameAreNotWritten) {
  scans_.assign(1, Scan{.points = {{8.05F, 0, 0}}});
  poses_.assign(1, Pose::Identity());
  poses_[0].translation() << 0, 50, 0;
  outline_.extents.assign(1, Eigen::AlignedBox3d(Eigen::Vector3d::Zero(), Eigen::Vector3d(8.1, 0, 0)));
  const MergeResult far = Merged(*head_);
  EXPECT_EQ(std::ranges::count(far.changed, BlockKeyOf(column_[0]), &Block::key), 0);
}

TEST(Origin, IsSetByASessionFarFromZeroAndRounded) {
  Pose pose = Pose::Identity();
  pose.translation() << 6000, 8000, 0;
  EXPECT_FALSE(OriginFor(pose).has_value());
  pose.translation() << 691'234, 5'335'678, 512;
  EXPECT_EQ(*OriginFor(pose), Eigen::Vector3d(691'200, 5'335'700, 500));
}

}  // namespace
}  // namespace mapkeep
