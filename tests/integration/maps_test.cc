#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/integration/daemon_process.h"
#include "tests/integration/robot.h"
#include "tests/integration/status_matchers.h"

namespace mapkeep {
namespace {

using grpc::StatusCode;

class Maps : public ::testing::Test {
 protected:
  DaemonProcess daemon_;
  Robot robot_{daemon_.listen()};
};

TEST_F(Maps, OutliveTheDaemon) {
  v1::CreateMapRequest request;
  v1::CreateMapResponse response;
  request.set_name("site");
  request.set_voxel_size(0.5);
  request.set_crs("EPSG:25832");
  request.mutable_origin()->set_x(691'000);
  ASSERT_THAT(robot_.maps().CreateMap(Robot::Call().get(), request, &response), IsOk());
  daemon_.Kill();
  daemon_.Start();
  v1::Map map;
  ASSERT_THAT(Robot(daemon_.listen()).GetMap("site", map), IsOk());
  EXPECT_EQ(map.SerializeAsString(), response.map().SerializeAsString());
  EXPECT_EQ(map.voxel_size(), 0.5);
  EXPECT_EQ(map.epoch(), 0U);
}

TEST_F(Maps, BadOnesAreRefused) {
  EXPECT_THAT(robot_.CreateMap("../x"), FailsWith(StatusCode::INVALID_ARGUMENT, {"map name"}));
  EXPECT_THAT(robot_.CreateMap("fine", 0.01), FailsWith(StatusCode::INVALID_ARGUMENT, {"voxel_size", "0.05"}));
  EXPECT_THAT(robot_.CreateMap("coarse", 2), FailsWith(StatusCode::INVALID_ARGUMENT, {"voxel_size"}));
  EXPECT_THAT(robot_.CreateMap("nan", std::numeric_limits<double>::quiet_NaN()),
              FailsWith(StatusCode::INVALID_ARGUMENT, {"voxel_size"}));
  ASSERT_THAT(robot_.CreateMap("site"), IsOk());
  EXPECT_THAT(robot_.CreateMap("site"), FailsWith(StatusCode::ALREADY_EXISTS, {"site"}));
  v1::Map map;
  EXPECT_THAT(robot_.GetMap("nowhere", map), FailsWith(StatusCode::NOT_FOUND, {"nowhere"}));
}

TEST_F(Maps, AreListedByNamePageByPage) {
  for (const char* name : {"c", "a", "e", "b", "d"}) ASSERT_THAT(robot_.CreateMap(name), IsOk());
  v1::ListMapsRequest request;
  v1::ListMapsResponse response;
  request.set_page_size(2);
  std::string names;
  int pages = 0;
  do {
    ASSERT_THAT(robot_.maps().ListMaps(Robot::Call().get(), request, &response), IsOk());
    for (const v1::Map& map : response.maps()) names += map.name();
    request.set_page_token(response.next_page_token());
  } while (!response.next_page_token().empty() && ++pages < 10);
  EXPECT_EQ(names, "abcde");
  request.set_page_token("%%%");
  EXPECT_THAT(robot_.maps().ListMaps(Robot::Call().get(), request, &response),
              FailsWith(StatusCode::INVALID_ARGUMENT, {"page_token"}));
}

TEST_F(Maps, SessionsAreListedInOrderOfCreationPageByPage) {
  ASSERT_THAT(robot_.CreateMap("site"), IsOk());
  const auto scans = Wire(Drive{{{.points = {{1, 2, 3}}, .intensities = {0}}}, {Pose::Identity()}});
  for (const char* id : {"c", "a", "b"}) ASSERT_THAT(robot_.Begin("site", id, scans), IsOk());
  v1::ListSessionsRequest request;
  v1::ListSessionsResponse response;
  request.set_map("site");
  request.set_page_size(1);
  std::string ids;
  int pages = 0;
  do {
    ASSERT_THAT(robot_.sessions().ListSessions(Robot::Call().get(), request, &response), IsOk());
    for (const v1::Session& session : response.sessions()) ids += session.id();
    request.set_page_token(response.next_page_token());
  } while (!response.next_page_token().empty() && ++pages < 10);
  EXPECT_EQ(ids, "cab");
  request.set_map("nowhere");
  EXPECT_THAT(robot_.sessions().ListSessions(Robot::Call().get(), request, &response),
              FailsWith(StatusCode::NOT_FOUND, {"nowhere"}));
}

TEST_F(Maps, AnEmptyOneStreamsItsHeaderAndNothingElse) {
  ASSERT_THAT(robot_.CreateMap("site"), IsOk());
  v1::StreamTilesRequest request;
  v1::StreamTilesResponse response;
  request.set_map("site");
  auto call = Robot::Call();
  auto stream = robot_.tiles().StreamTiles(call.get(), request);
  ASSERT_TRUE(stream->Read(&response));
  EXPECT_EQ(response.header().epoch(), 0U);
  EXPECT_EQ(response.header().voxel_size(), 0.2);
  EXPECT_FALSE(stream->Read(&response));
  EXPECT_THAT(stream->Finish(), IsOk());

  request.set_epoch(1);
  call = Robot::Call();
  stream = robot_.tiles().StreamTiles(call.get(), request);
  EXPECT_FALSE(stream->Read(&response));
  EXPECT_THAT(stream->Finish(), FailsWith(StatusCode::NOT_FOUND, {}));

  request.clear_epoch();
  request.mutable_box();  // min is not below max
  call = Robot::Call();
  stream = robot_.tiles().StreamTiles(call.get(), request);
  EXPECT_FALSE(stream->Read(&response));
  EXPECT_THAT(stream->Finish(), FailsWith(StatusCode::INVALID_ARGUMENT, {"box"}));
}

TEST_F(Maps, AVoxelThatWasNeverHitIsNotFound) {
  ASSERT_THAT(robot_.CreateMap("site"), IsOk());
  v1::QueryVoxelRequest request;
  v1::QueryVoxelResponse response;
  request.set_map("site");
  EXPECT_THAT(robot_.maps().QueryVoxel(Robot::Call().get(), request, &response),
              FailsWith(StatusCode::NOT_FOUND, {"site"}));
  request.mutable_point()->set_x(1e9);
  EXPECT_THAT(robot_.maps().QueryVoxel(Robot::Call().get(), request, &response),
              FailsWith(StatusCode::OUT_OF_RANGE, {"range"}));
}

}  // namespace
}  // namespace mapkeep
