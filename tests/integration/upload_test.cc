#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "mapkeep/v1/common.pb.h"
#include "tests/integration/daemon_process.h"
#include "tests/integration/robot.h"
#include "tests/integration/status_matchers.h"

namespace mapkeep {
namespace {

using grpc::StatusCode;

// A handful of points is a scan as far as the upload is concerned.
Drive ShortDrive(int scans, float x = 1) {
  Drive drive;
  for (int i = 0; i < scans; ++i) {
    drive.scans.push_back(
        {.points = {{x, 2, 3}, {4, 5, static_cast<float>(i)}}, .intensities = {0, 1}, .time = 1e9 + i});
    drive.poses.push_back(Pose::Identity());
  }
  return drive;
}

uint32_t DurableScans(Robot& robot, const std::string& id) {
  v1::Session session;
  EXPECT_THAT(robot.GetSession("site", id, session), IsOk());
  return session.durable_scans();
}

class Uploads : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    daemon_ = new DaemonProcess;
    ASSERT_THAT(Robot(daemon_->listen()).CreateMap("site"), IsOk());
  }
  static void TearDownTestSuite() {
    delete daemon_;
    daemon_ = nullptr;
  }

  // Whatever a test did: the daemon takes and acknowledges a good session, and serves tiles.
  void TearDown() override {
    ASSERT_TRUE(daemon_->is_running()) << daemon_->log();
    Robot other(daemon_->listen());
    const std::string id = std::string("after.") + ::testing::UnitTest::GetInstance()->current_test_info()->name();
    const auto scans = Wire(ShortDrive(2));
    EXPECT_THAT(other.Begin("site", id, scans), IsOk());
    EXPECT_THAT(other.Send("site", id, scans), IsOk());
    EXPECT_EQ(DurableScans(other, id), 2U);
    other.Tiles("site", true);
  }

  // Begins a session of these scans and sends them.
  grpc::Status Upload(const std::string& id, const std::vector<WireScan>& scans) {
    EXPECT_THAT(robot_.Begin("site", id, scans), IsOk());
    return robot_.Send("site", id, scans);
  }

  static DaemonProcess* daemon_;
  Robot robot_{daemon_->listen()};
};

DaemonProcess* Uploads::daemon_ = nullptr;

TEST_F(Uploads, AreAcknowledgedAndMayBeAskedFor) {
  const auto scans = Wire(ShortDrive(5));
  EXPECT_THAT(Upload("five", scans), IsOk());
  EXPECT_EQ(DurableScans(robot_, "five"), 5U);
  v1::Session session;
  EXPECT_THAT(robot_.Begin("site", "five", scans, &session), IsOk());
  EXPECT_EQ(session.durable_scans(), 5U);
}

TEST_F(Uploads, GoOnWhereTheyBrokeOff) {
  const auto scans = Wire(ShortDrive(6));
  ASSERT_THAT(robot_.Begin("site", "broken", scans), IsOk());
  ASSERT_THAT(robot_.Send("site", "broken", {scans.begin(), scans.begin() + 4}), IsOk());
  EXPECT_THAT(robot_.Commit("site", "broken"), FailsWith(StatusCode::FAILED_PRECONDITION, {"4 of 6"}));
  EXPECT_EQ(DurableScans(robot_, "broken"), 4U);
  EXPECT_THAT(robot_.Send("site", "broken", {scans.begin() + 4, scans.end()}), IsOk());
  EXPECT_EQ(DurableScans(robot_, "broken"), 6U);
}

TEST_F(Uploads, AStreamClosedHalfWayKeepsWhatWasWhole) {
  auto scans = Wire(ShortDrive(3));
  ASSERT_THAT(robot_.Begin("site", "half", scans), IsOk());
  scans[2].bytes.resize(20);
  EXPECT_THAT(robot_.Send("site", "half", scans),
              FailsWith(StatusCode::INVALID_ARGUMENT, {"scan 2", "20 of 32 bytes"}));
  EXPECT_EQ(DurableScans(robot_, "half"), 2U);
}

TEST_F(Uploads, AWrongIndexIsToldTheRightOne) {
  const auto scans = Wire(ShortDrive(4));
  ASSERT_THAT(robot_.Begin("site", "gap", scans), IsOk());
  const grpc::Status status = robot_.Send("site", "gap", {scans[0], scans[2]});
  EXPECT_THAT(status, FailsWith(StatusCode::OUT_OF_RANGE, {"scan 2", "expected scan 1"}));
  v1::ExpectedScan expected;
  ASSERT_TRUE(expected.ParseFromString(status.error_details()));
  EXPECT_EQ(expected.index(), 1U);
  EXPECT_THAT(robot_.Send("site", "gap", {scans.begin() + 1, scans.end()}), IsOk());
  auto beyond = scans[0];
  beyond.header.set_index(4);
  EXPECT_THAT(robot_.Send("site", "gap", {beyond}), FailsWith(StatusCode::OUT_OF_RANGE, {"4 scans"}));
}

TEST_F(Uploads, UnknownMapsAndSessionsAreNamed) {
  const auto scans = Wire(ShortDrive(1));
  EXPECT_THAT(robot_.Begin("nowhere", "s", scans), FailsWith(StatusCode::NOT_FOUND, {"nowhere"}));
  EXPECT_THAT(robot_.Send("nowhere", "s", scans), FailsWith(StatusCode::NOT_FOUND, {"nowhere"}));
  EXPECT_THAT(robot_.Send("site", "unheard-of", scans), FailsWith(StatusCode::NOT_FOUND, {"unheard-of"}));
  EXPECT_THAT(robot_.Begin("site", "../up", scans), FailsWith(StatusCode::INVALID_ARGUMENT, {"session id"}));
  EXPECT_THAT(robot_.Begin("site", "none", {}), FailsWith(StatusCode::INVALID_ARGUMENT, {"scan_crc32c"}));
}

TEST_F(Uploads, BadValuesAreRefusedWithScanAndPoint) {
  Drive holed = ShortDrive(3);
  holed.scans[1].points[1].y() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(Upload("holed", Wire(holed)), FailsWith(StatusCode::INVALID_ARGUMENT, {"scan 1", "point 1", "finite"}));
  EXPECT_EQ(DurableScans(robot_, "holed"), 1U);
  Drive far = ShortDrive(3);
  far.poses[2].translation().x() = 900'000;
  EXPECT_THAT(Upload("far", Wire(far)), FailsWith(StatusCode::INVALID_ARGUMENT, {"scan 2", "point 0", "range"}));
  EXPECT_EQ(DurableScans(robot_, "far"), 2U);
}

TEST_F(Uploads, DamageOnTheWayIsDataLoss) {
  auto scans = Wire(ShortDrive(2));
  ASSERT_THAT(robot_.Begin("site", "damaged", scans), IsOk());
  auto damaged = scans;
  damaged[1].bytes[5] = static_cast<char>(damaged[1].bytes[5] ^ 4);
  EXPECT_THAT(robot_.Send("site", "damaged", damaged), FailsWith(StatusCode::DATA_LOSS, {"scan 1"}));
  EXPECT_THAT(robot_.Send("site", "damaged", {scans[1]}), IsOk());
}

TEST_F(Uploads, WhatIsKnownOfThePlaceIsCheckedWhenASessionBegins) {
  const auto scans = Wire(ShortDrive(2));
  v1::BeginSessionRequest request;
  v1::BeginSessionResponse response;
  request.set_map("site");
  request.set_id("placed");
  for (const WireScan& scan : scans) request.add_scan_crc32c(scan.header.crc32c());
  const auto begin = [&] { return robot_.sessions().BeginSession(Robot::Call().get(), request, &response); };
  request.mutable_initial_pose()->set_yaw(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THAT(begin(), FailsWith(StatusCode::INVALID_ARGUMENT, {"initial_pose", "finite"}));
  request.clear_initial_pose();
  request.mutable_gnss()->mutable_position()->set_x(691'234);
  EXPECT_THAT(begin(), FailsWith(StatusCode::INVALID_ARGUMENT, {"gnss", "site", "no CRS"}));

  v1::CreateMapRequest create;
  v1::CreateMapResponse created;
  create.set_name("surveyed");
  create.set_crs("EPSG:25832");
  ASSERT_THAT(robot_.maps().CreateMap(Robot::Call().get(), create, &created), IsOk());
  request.set_map("surveyed");
  EXPECT_THAT(begin(), FailsWith(StatusCode::INVALID_ARGUMENT, {"gnss.covariance", "0 values", "9"}));
  for (int i = 0; i < 9; ++i) request.mutable_gnss()->add_covariance(1);
  EXPECT_THAT(begin(), FailsWith(StatusCode::INVALID_ARGUMENT, {"gnss.covariance", "positive"}));
  for (int i = 0; i < 9; ++i) request.mutable_gnss()->set_covariance(i, i % 4 == 0 ? 4 : 0);
  EXPECT_THAT(begin(), IsOk());
}

TEST_F(Uploads, OneIdIsOneContent) {
  ASSERT_THAT(Upload("same", Wire(ShortDrive(2))), IsOk());
  EXPECT_THAT(robot_.Begin("site", "same", Wire(ShortDrive(2, 7))), FailsWith(StatusCode::ALREADY_EXISTS, {"same"}));
  EXPECT_THAT(robot_.Begin("site", "same", Wire(ShortDrive(3))), FailsWith(StatusCode::ALREADY_EXISTS, {"same"}));
  const auto promised = Wire(ShortDrive(1));
  ASSERT_THAT(robot_.Begin("site", "other", promised), IsOk());
  EXPECT_THAT(robot_.Send("site", "other", Wire(ShortDrive(1, 7))),
              FailsWith(StatusCode::INVALID_ARGUMENT, {"scan 0", "promised"}));
}

TEST_F(Uploads, TheLaterOfTwoAtATimeIsAborted) {
  const auto scans = Wire(ShortDrive(2));
  ASSERT_THAT(robot_.Begin("site", "twice", scans), IsOk());
  const auto call = Robot::Call();
  const auto first = robot_.Open(*call, "site", "twice");
  v1::UploadScansResponse response;
  ASSERT_TRUE(first->Read(&response));  // it has the session now
  EXPECT_THAT(Robot(daemon_->listen()).Send("site", "twice", scans), FailsWith(StatusCode::ABORTED, {"twice"}));
  for (const WireScan& scan : scans) ASSERT_TRUE(Robot::Send(*first, scan));
  first->WritesDone();
  while (first->Read(&response)) continue;
  EXPECT_THAT(first->Finish(), IsOk());
  EXPECT_EQ(response.durable_scans(), 2U);
}

TEST_F(Uploads, AClientThatVanishesLeavesItsPlace) {
  const auto scans = Wire(ShortDrive(3));
  ASSERT_THAT(robot_.Begin("site", "vanishing", scans), IsOk());
  {
    Robot vanishing(daemon_->listen());
    const auto call = Robot::Call();
    const auto upload = vanishing.Open(*call, "site", "vanishing");
    ASSERT_TRUE(Robot::Send(*upload, scans[0]));
    v1::UploadScansResponse response;
    while (response.durable_scans() < 1) ASSERT_TRUE(upload->Read(&response));
    call->TryCancel();
    upload->Finish();
  }
  grpc::Status status;
  for (int tries = 0; tries < 1000; ++tries) {  // until the daemon has heard of it
    status = robot_.Send("site", "vanishing", {scans.begin() + 1, scans.end()});
    if (status.error_code() != StatusCode::ABORTED) break;
  }
  EXPECT_THAT(status, IsOk());
  EXPECT_EQ(DurableScans(robot_, "vanishing"), 3U);
}

TEST_F(Uploads, OutOfOrderMessagesAreRefused) {
  const auto scans = Wire(ShortDrive(1));
  ASSERT_THAT(robot_.Begin("site", "disorder", scans), IsOk());
  {
    const auto call = Robot::Call();
    const auto upload = robot_.sessions().UploadScans(call.get());
    Robot::Send(*upload, scans[0]);
    EXPECT_THAT(Robot::End(*upload), FailsWith(StatusCode::INVALID_ARGUMENT, {"open"}));
  }
  {
    const auto call = Robot::Call();
    const auto upload = robot_.Open(*call, "site", "disorder");
    v1::UploadScansRequest request;
    request.set_chunk("no header");
    upload->Write(request);
    EXPECT_THAT(Robot::End(*upload), FailsWith(StatusCode::INVALID_ARGUMENT, {"header"}));
  }
  {
    const auto call = Robot::Call();
    const auto upload = robot_.Open(*call, "site", "disorder");
    v1::UploadScansRequest request;
    *request.mutable_scan() = scans[0].header;
    request.mutable_scan()->set_point_count(201'326'592);  // 3 GiB
    upload->Write(request);
    EXPECT_THAT(Robot::End(*upload), FailsWith(StatusCode::INVALID_ARGUMENT, {"scan 0", "4000000"}));
  }
}

// Bytes as the messages of one upload, whatever they are; the status that it ends with.
grpc::Status SendBytes(const std::shared_ptr<grpc::Channel>& channel, const std::vector<std::string>& messages) {
  grpc::GenericStub stub(channel);
  grpc::CompletionQueue queue;
  const auto context = Robot::Call();
  const auto call = stub.PrepareCall(context.get(), "/mapkeep.v1.SessionService/UploadScans", &queue);
  const auto next = [&queue] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  call->StartCall(nullptr);
  bool alive = next();
  for (const std::string& message : messages) {
    if (!alive) break;
    const grpc::Slice slice(message);
    call->Write(grpc::ByteBuffer(&slice, 1), nullptr);
    alive = next();
  }
  if (alive) {
    call->WritesDone(nullptr);
    next();
  }
  grpc::ByteBuffer answer;
  do {
    call->Read(&answer, nullptr);
  } while (next());
  grpc::Status status;
  call->Finish(&status, nullptr);
  next();
  return status;
}

TEST_F(Uploads, BytesThatAreNoMessageAreNamedAndWhatCameBeforeThemStays) {
  const auto scans = Wire(ShortDrive(2));
  ASSERT_THAT(robot_.Begin("site", "garbled", scans), IsOk());
  EXPECT_THAT(SendBytes(robot_.channel(), {"\xff\xff\xff"}),
              FailsWith(StatusCode::INVALID_ARGUMENT, {"message 0", "mapkeep.v1.UploadScansRequest"}));
  v1::UploadScansRequest open, header, chunk;
  open.mutable_open()->set_map("site");
  open.mutable_open()->set_id("garbled");
  *header.mutable_scan() = scans[0].header;
  chunk.set_chunk(scans[0].bytes);
  const std::string cut = chunk.SerializeAsString().substr(0, 10);
  EXPECT_THAT(SendBytes(robot_.channel(), {open.SerializeAsString(), header.SerializeAsString(),
                                           chunk.SerializeAsString(), cut, chunk.SerializeAsString()}),
              FailsWith(StatusCode::INVALID_ARGUMENT, {"message 3", "mapkeep.v1.UploadScansRequest"}));
  EXPECT_EQ(DurableScans(robot_, "garbled"), 1U);
  EXPECT_THAT(SendBytes(robot_.channel(), {open.SerializeAsString(), ""}),
              FailsWith(StatusCode::INVALID_ARGUMENT, {"without `open`, `scan` or `chunk`"}));
  EXPECT_THAT(robot_.Send("site", "garbled", {scans[1]}), IsOk());
}

TEST_F(Uploads, AScanMayComeInAsManyMessagesAsItHasBytes) {
  const auto scans = Wire(ShortDrive(2));
  ASSERT_THAT(robot_.Begin("site", "crumbs", scans), IsOk());
  v1::UploadScansRequest message;
  message.mutable_open()->set_map("site");
  message.mutable_open()->set_id("crumbs");
  std::vector<std::string> messages = {message.SerializeAsString()};
  for (const WireScan& scan : scans) {
    *message.mutable_scan() = scan.header;
    messages.push_back(message.SerializeAsString());
    for (const char byte : scan.bytes) {
      for (const std::string& chunk : {std::string(), std::string(1, byte)}) {
        message.set_chunk(chunk);
        messages.push_back(message.SerializeAsString());
      }
    }
  }
  EXPECT_THAT(SendBytes(robot_.channel(), messages), IsOk());
  EXPECT_EQ(DurableScans(robot_, "crumbs"), 2U);
}

TEST_F(Uploads, AMessageBeyondTheLimitIsRefused) {
  ASSERT_THAT(robot_.Begin("site", "huge", Wire(ShortDrive(1))), IsOk());
  const auto call = Robot::Call();
  const auto upload = robot_.Open(*call, "site", "huge");
  v1::UploadScansRequest request;
  request.set_chunk(std::string(9 << 20, 'x'));
  upload->Write(request);
  EXPECT_THAT(Robot::End(*upload), FailsWith(StatusCode::RESOURCE_EXHAUSTED, {"8388608"}));
}

TEST_F(Uploads, ASessionMayBeDeletedWhileItUploads) {
  const auto scans = Wire(ShortDrive(2));
  ASSERT_THAT(robot_.Begin("site", "gone", scans), IsOk());
  const auto call = Robot::Call();
  const auto upload = robot_.Open(*call, "site", "gone");
  v1::UploadScansResponse response;
  ASSERT_TRUE(upload->Read(&response));
  ASSERT_THAT(Robot(daemon_->listen()).DeleteSession("site", "gone"), IsOk());
  Robot::Send(*upload, scans[0]);
  EXPECT_THAT(Robot::End(*upload), FailsWith(StatusCode::NOT_FOUND, {"gone"}));
}

}  // namespace
}  // namespace mapkeep
