// Tiles for robots, through a real daemon.

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>

#include <fstream>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tests/integration/daemon_process.h"
#include "tests/integration/robot.h"
#include "tests/integration/status_matchers.h"

namespace mapkeep {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;
using Place = std::pair<int, int>;
using Versions = std::map<Place, std::string>;

constexpr double kStart = 1.79e9;  // seconds since 1970
constexpr double kTileEdge = 128 * 0.2;

Place PlaceOf(const v1::TileId& id) { return {id.x(), id.y()}; }

/// What a SyncTiles call answered.
struct Sync {
  v1::SyncTilesHeader header;
  std::map<Place, v1::MapTile> tiles;
  std::vector<v1::TileInfo> infos;
  grpc::Status status;
};

class Tiles : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_THAT(robot_.CreateMap("street"), IsOk()); }

  void Merge(const std::string& id, int day, const Eigen::Vector3d& offset = {0, 0, 0}) {
    Scene scene = Street();
    if (day % 2 == 0) scene.push_back(Car());
    Drive drive = DriveAlong(scene, 16, kStart + 86400.0 * day);
    for (Pose& pose : drive.poses) pose.translation() += offset;
    ASSERT_THAT(robot_.UploadDrive("street", id, drive, true), IsOk());
    // A watch ends after limits.watch_seconds; on a busy machine the session takes longer.
    v1::Session session;
    for (int watches = 0; watches < 30 && session.state() < v1::SESSION_STATE_COMMITTED; ++watches) {
      session = robot_.Watch("street", id);
    }
    ASSERT_EQ(session.state(), v1::SESSION_STATE_COMMITTED) << session.reason();
  }

  std::vector<v1::TileInfo> List(uint32_t page_size = 0, const v1::Box* area = nullptr) {
    v1::ListTilesRequest request;
    request.set_map("street");
    request.set_page_size(page_size);
    request.set_detail(v1::TILE_DETAIL_SUB_VOXELS);
    if (area != nullptr) *request.mutable_area() = *area;
    std::vector<v1::TileInfo> tiles;
    do {
      v1::ListTilesResponse response;
      EXPECT_THAT(robot_.tiles().ListTiles(Robot::Call().get(), request, &response), IsOk());
      tiles.insert(tiles.end(), response.tiles().begin(), response.tiles().end());
      request.set_page_token(response.next_page_token());
    } while (!request.page_token().empty());
    return tiles;
  }

  Sync SyncWith(const v1::SyncTilesRequest& request) {
    Sync sync;
    const auto call = Robot::Call();
    const auto stream = robot_.tiles().SyncTiles(call.get(), request);
    v1::SyncTilesResponse response;
    while (stream->Read(&response)) {
      if (response.has_header()) sync.header = response.header();
      if (response.has_tile()) sync.tiles[PlaceOf(response.tile().id())] = response.tile();
      if (response.has_info()) sync.infos.push_back(response.info());
    }
    sync.status = stream->Finish();
    return sync;
  }

  static v1::SyncTilesRequest Holding(const Versions& held) {
    v1::SyncTilesRequest request;
    request.set_map("street");
    request.set_detail(v1::TILE_DETAIL_SUB_VOXELS);
    for (const auto& [place, version] : held) {
      v1::TileVersion& tile = *request.add_held();
      tile.mutable_id()->set_x(place.first);
      tile.mutable_id()->set_y(place.second);
      tile.set_version(version);
    }
    return request;
  }

  static Versions VersionsOf(const Sync& sync) {
    Versions versions;
    for (const auto& [place, tile] : sync.tiles) versions[place] = tile.version();
    return versions;
  }

  void RollBack(uint64_t epoch) {
    v1::RollBackMapRequest request;
    request.set_map("street");
    request.set_epoch(epoch);
    v1::RollBackMapResponse response;
    ASSERT_THAT(robot_.maps().RollBackMap(Robot::Call().get(), request, &response), IsOk());
  }

  static std::string SettingsIn(const TemporaryDirectory& directory) {
    std::ofstream(directory.path() + "/mapkeepd.toml") << "[limits]\nwatch_seconds = 4\n";
    return directory.path() + "/mapkeepd.toml";
  }

  const TemporaryDirectory settings_;
  DaemonProcess daemon_{{"--config", SettingsIn(settings_)}};
  Robot robot_{daemon_.listen()};
};

v1::Box Area(double min_x, double min_y, double max_x, double max_y) {
  v1::Box box;
  box.mutable_min()->set_x(min_x);
  box.mutable_min()->set_y(min_y);
  box.mutable_max()->set_x(max_x);
  box.mutable_max()->set_y(max_y);
  return box;
}

TEST_F(Tiles, AListSaysWhatEachTileIsAndHowLongItsMessage) {
  EXPECT_THAT(List(), IsEmpty());
  Merge("day-1", 1);
  const std::vector<v1::TileInfo> listed = List();
  ASSERT_GE(listed.size(), 2U);
  const Sync all = SyncWith(Holding({}));
  ASSERT_THAT(all.status, IsOk());
  ASSERT_THAT(all.tiles, SizeIs(listed.size()));
  uint64_t bytes = 0;
  for (const v1::TileInfo& info : listed) {
    const v1::MapTile& tile = all.tiles.at(PlaceOf(info.id()));
    EXPECT_EQ(tile.version(), info.version());
    EXPECT_EQ(tile.ByteSizeLong(), info.bytes());
    EXPECT_EQ(static_cast<uint64_t>(tile.layers_size()), info.voxels());
    bytes += info.bytes();
  }
  EXPECT_EQ(all.header.changed_bytes(), bytes);
  EXPECT_EQ(all.header.changed_tiles(), listed.size());
  EXPECT_THAT(List(1), SizeIs(listed.size()));  // a page a tile
}

TEST_F(Tiles, ATileIsTheStaticVoxelsOfTheMap) {
  Merge("day-1", 1);
  // By another way: the blocks that tools read.
  std::map<Place, size_t> expected;
  std::map<std::tuple<int, int, int>, uint64_t> masks;
  std::map<std::tuple<int, int, int>, double> stabilities;
  for (const v1::VoxelBlock& block : robot_.Tiles("street", false)) {
    expected[{block.x() >> 2, block.y() >> 2}] += block.positions_size();
    for (int i = 0; i < block.positions_size(); ++i) {
      const uint32_t at = block.positions(i);
      const std::tuple voxel(32 * block.x() + static_cast<int>(at & 31),
                             32 * block.y() + static_cast<int>(at >> 5 & 31),
                             32 * block.z() + static_cast<int>(at >> 10));
      masks[voxel] = block.masks(i);
      stabilities[voxel] = 255.0 * block.hits(i) / (block.hits(i) + block.exposures(i));
    }
  }
  const Sync all = SyncWith(Holding({}));
  ASSERT_EQ(all.tiles.size(), expected.size());
  size_t ground = 0;
  for (const auto& [place, tile] : all.tiles) {
    EXPECT_EQ(static_cast<size_t>(tile.layers_size()), expected[place]);
    for (int n = 0; n < tile.layers_size(); ++n) {
      const auto column = [&tile, n](int at) { return static_cast<uint8_t>(tile.columns()[2 * n + at]); };
      const auto found = masks.find({128 * tile.id().x() + column(0), 128 * tile.id().y() + column(1), tile.layers(n)});
      ASSERT_NE(found, masks.end());
      EXPECT_EQ(tile.masks(n), found->second);
      EXPECT_NEAR(static_cast<uint8_t>(tile.stabilities()[n]), stabilities.at(found->first), 1);
      masks.erase(found);
      ground += tile.flags()[n] & 1;
    }
  }
  EXPECT_THAT(masks, IsEmpty());
  EXPECT_GT(ground, 100U);
}

TEST_F(Tiles, WhoHoldsTheNewestGetsNothingAndWhoHoldsOthersTheDifference) {
  Merge("day-1", 1);
  const Versions first = VersionsOf(SyncWith(Holding({})));
  const Sync same = SyncWith(Holding(first));
  EXPECT_THAT(same.tiles, IsEmpty());
  EXPECT_THAT(same.header.dropped(), IsEmpty());
  EXPECT_EQ(same.header.tiles(), first.size());

  Merge("day-2", 2);
  const Sync changed = SyncWith(Holding(first));
  ASSERT_THAT(changed.status, IsOk());
  EXPECT_EQ(changed.header.epoch(), 2U);
  Versions held = first;
  for (const auto& [place, version] : VersionsOf(changed)) {
    EXPECT_NE(held[place], version);
    held[place] = version;
  }
  EXPECT_EQ(held, VersionsOf(SyncWith(Holding({}))));

  // A rollback brings the content back, and with it the versions.
  RollBack(1);
  Versions back = held;
  const Sync undone = SyncWith(Holding(held));
  EXPECT_EQ(undone.header.epoch(), 3U);
  for (const v1::TileId& id : undone.header.dropped()) back.erase(PlaceOf(id));
  for (const auto& [place, version] : VersionsOf(undone)) back[place] = version;
  EXPECT_EQ(back, first);
}

TEST_F(Tiles, WhatIsHeldOutsideOfTheAreaOrNoLongerThereIsToBeDropped) {
  Merge("day-1", 1);
  Versions held = VersionsOf(SyncWith(Holding({})));
  const Place kept = held.begin()->first;
  held[{77, -77}] = "of another time";
  v1::SyncTilesRequest request = Holding(held);
  *request.mutable_area() = Area(kTileEdge * kept.first, kTileEdge * kept.second, kTileEdge * (kept.first + 1),
                                 kTileEdge * (kept.second + 1));
  const Sync sync = SyncWith(request);
  ASSERT_THAT(sync.status, IsOk());
  EXPECT_THAT(sync.tiles, IsEmpty());
  EXPECT_EQ(sync.header.tiles(), 1U);
  std::set<Place> dropped;
  for (const v1::TileId& id : sync.header.dropped()) dropped.insert(PlaceOf(id));
  std::set<Place> expected;
  for (const auto& [place, version] : held) expected.insert(place);
  expected.erase(kept);
  EXPECT_EQ(dropped, expected);
  EXPECT_THAT(List(0, &request.area()), SizeIs(1));
}

TEST_F(Tiles, MayBeChosenFromAListAndFetchedById) {
  Merge("day-1", 1);
  v1::SyncTilesRequest ask = Holding({});
  ask.set_list_only(true);
  const Sync sync = SyncWith(ask);
  ASSERT_GE(sync.infos.size(), 2U);
  v1::GetTilesRequest request;
  request.set_map("street");
  request.set_epoch(sync.header.epoch());
  *request.add_ids() = sync.infos.back().id();
  *request.add_ids() = sync.infos.back().id();  // once all the same
  request.add_ids()->set_x(500);                // not there
  const auto call = Robot::Call();
  const auto stream = robot_.tiles().GetTiles(call.get(), request);
  v1::GetTilesResponse response;
  ASSERT_TRUE(stream->Read(&response));
  EXPECT_EQ(response.header().epoch(), 1U);
  ASSERT_TRUE(stream->Read(&response));
  EXPECT_EQ(response.tile().version(), sync.infos.back().version());
  EXPECT_THAT(response.tile().masks(), IsEmpty());  // centroids, if nothing is said
  EXPECT_FALSE(stream->Read(&response));
  EXPECT_THAT(stream->Finish(), IsOk());
}

TEST_F(Tiles, BadQuestionsAreToldWhatIsWrong) {
  v1::SyncTilesRequest request = Holding({{{5, 5}, "a"}});
  *request.add_held() = request.held(0);
  EXPECT_THAT(SyncWith(request).status, FailsWith(grpc::StatusCode::INVALID_ARGUMENT, {"(5, 5) twice"}));
  request = Holding({{{9000, 0}, "a"}});
  EXPECT_THAT(SyncWith(request).status, FailsWith(grpc::StatusCode::INVALID_ARGUMENT, {"(9000, 0)", "8191"}));
  request = Holding({});
  *request.mutable_area() = Area(1, 1, 1, 2);
  EXPECT_THAT(SyncWith(request).status, FailsWith(grpc::StatusCode::INVALID_ARGUMENT, {"area"}));
  request = Holding({});
  request.set_epoch(4);
  EXPECT_THAT(SyncWith(request).status, FailsWith(grpc::StatusCode::NOT_FOUND, {"epoch 4"}));
  request.set_map("nowhere");
  EXPECT_THAT(SyncWith(request).status, FailsWith(grpc::StatusCode::NOT_FOUND, {"nowhere"}));
}

/// A WatchMap call.
class MapWatcher {
 public:
  MapWatcher(Robot& robot, const std::string& map, const std::string& token) {
    v1::WatchMapRequest request;
    request.set_map(map);
    request.set_resume_token(token);
    stream_ = robot.tiles().WatchMap(call_.get(), request);
  }
  ~MapWatcher() {
    if (ended_) return;
    call_->TryCancel();
    stream_->Finish();
  }
  v1::WatchMapResponse Next() {
    v1::WatchMapResponse response;
    EXPECT_TRUE(stream_->Read(&response));
    return response;
  }
  grpc::Status End() {
    v1::WatchMapResponse response;
    EXPECT_FALSE(stream_->Read(&response));
    ended_ = true;
    return stream_->Finish();
  }

 private:
  bool ended_ = false;
  std::unique_ptr<grpc::ClientContext> call_ = Robot::Call();
  std::unique_ptr<grpc::ClientReader<v1::WatchMapResponse>> stream_;
};

TEST_F(Tiles, AWatchTellsEveryEpochWithWhatItTouched) {
  MapWatcher watcher(robot_, "street", "");
  const v1::WatchMapResponse now = watcher.Next();
  EXPECT_EQ(now.epoch(), 0U);
  EXPECT_TRUE(now.any_tile());
  Merge("day-1", 1);
  const Sync all = SyncWith(Holding({}));
  const v1::WatchMapResponse first = watcher.Next();
  EXPECT_EQ(first.epoch(), 1U);
  EXPECT_EQ(first.session(), "day-1");
  EXPECT_FALSE(first.any_tile());
  std::set<Place> touched;
  for (const v1::TileId& id : first.touched_tiles()) touched.insert(PlaceOf(id));
  for (const auto& [place, tile] : all.tiles) EXPECT_TRUE(touched.contains(place));
}

TEST_F(Tiles, AWatchGoesOnWhereItEndedAlsoAfterAKill) {
  Merge("day-1", 1);
  const std::string token = MapWatcher(robot_, "street", "").Next().resume_token();
  Merge("day-2", 2);
  RollBack(1);
  daemon_.Kill();
  daemon_.Start();
  Robot robot(daemon_.listen());
  MapWatcher watcher(robot, "street", token);
  const v1::WatchMapResponse second = watcher.Next();
  EXPECT_EQ(second.epoch(), 2U);
  EXPECT_EQ(second.session(), "day-2");
  const v1::WatchMapResponse third = watcher.Next();
  EXPECT_EQ(third.epoch(), 3U);
  EXPECT_TRUE(third.rollback());
  EXPECT_FALSE(third.touched_tiles().empty());
  EXPECT_THAT(watcher.End(), IsOk());  // by itself, after limits.watch_seconds
}

TEST_F(Tiles, AWatchSaysWhenItsMapIsAnotherOrGone) {
  const std::string token = MapWatcher(robot_, "street", "").Next().resume_token();
  ASSERT_THAT(robot_.DeleteMap("street"), IsOk());
  EXPECT_THAT(MapWatcher(robot_, "street", token).End(), FailsWith(grpc::StatusCode::NOT_FOUND, {"street"}));
  ASSERT_THAT(robot_.CreateMap("street"), IsOk());
  EXPECT_TRUE(MapWatcher(robot_, "street", token).Next().any_tile());
  EXPECT_THAT(MapWatcher(robot_, "street", "made up").End(),
              FailsWith(grpc::StatusCode::INVALID_ARGUMENT, {"resume_token"}));
}

}  // namespace
}  // namespace mapkeep
