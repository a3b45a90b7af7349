#include "tests/integration/upkeep.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "tests/integration/status_matchers.h"

namespace mapkeep {

v1::VerifyMapResponse Verify(Robot& robot, const std::string& map) {
  v1::VerifyMapRequest request;
  request.set_map(map);
  v1::VerifyMapResponse response;
  grpc::ClientContext as_long_as_it_takes;
  EXPECT_THAT(robot.admin().VerifyMap(&as_long_as_it_takes, request, &response), IsOk());
  return response;
}

v1::ReplayMapResponse Replay(Robot& robot, const std::string& map) {
  v1::ReplayMapRequest request;
  request.set_map(map);
  v1::ReplayMapResponse response;
  grpc::ClientContext as_long_as_it_takes;
  EXPECT_THAT(robot.admin().ReplayMap(&as_long_as_it_takes, request, &response), IsOk());
  return response;
}

void ExpectWhole(Robot& robot, const std::string& map, uint64_t sessions) {
  v1::Map found;
  ASSERT_THAT(robot.GetMap(map, found), IsOk());
  EXPECT_EQ(found.epoch(), sessions);
  EXPECT_EQ(found.sessions(), sessions);
  EXPECT_THAT(Verify(robot, map).problems(), testing::IsEmpty());
  const v1::ReplayMapResponse replay = Replay(robot, map);
  EXPECT_EQ(replay.commits(), sessions);
  EXPECT_EQ(replay.different(), 0U) << replay.first_difference();
}

std::vector<std::string> SessionsOf(Robot& robot, const std::string& map) {
  std::vector<std::string> sessions;
  v1::ListVersionsRequest request;
  request.set_map(map);
  do {
    v1::ListVersionsResponse page;
    const grpc::Status status = robot.maps().ListVersions(Robot::Call().get(), request, &page);
    EXPECT_THAT(status, IsOk());
    if (!status.ok()) break;
    for (const v1::Version& version : page.versions()) {
      if (!version.session().empty()) sessions.push_back(version.session());
    }
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  std::ranges::reverse(sessions);
  return sessions;
}

}  // namespace mapkeep
