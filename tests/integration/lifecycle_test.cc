#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include <csignal>
#include <fstream>

#include "mapkeep/v1/common.pb.h"
#include "tests/integration/daemon_process.h"
#include "tests/integration/http_status.h"
#include "tests/integration/robot.h"
#include "tests/integration/status_matchers.h"

namespace mapkeep {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// One message of raw bytes to a method whose proto is not at hand; the answer's bytes.
std::string CallBytes(const Robot& robot, const std::string& method, const std::string& request) {
  grpc::GenericStub stub(robot.channel());
  grpc::CompletionQueue queue;
  const auto context = Robot::Call();
  const auto call = stub.PrepareCall(context.get(), method, &queue);
  const auto next = [&] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  call->StartCall(nullptr);
  next();
  const grpc::Slice slice(request);
  call->WriteLast(grpc::ByteBuffer(&slice, 1), {}, nullptr);
  next();
  grpc::ByteBuffer answer;
  call->Read(&answer, nullptr);
  next();
  grpc::Slice bytes;
  answer.DumpToSingleSlice(&bytes);
  return {reinterpret_cast<const char*>(bytes.begin()), bytes.size()};
}

TEST(Lifecycle, SigtermAndSigintEndItCleanly) {
  DaemonProcess daemon;
  for (const int signal : {SIGTERM, SIGINT}) {
    EXPECT_EQ(daemon.End(signal), 0) << daemon.log();
    daemon.Start();
  }
}

TEST(Lifecycle, SigtermEndsItWhileAClientWatchesAndAnotherUploads) {
  DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("site"), IsOk());
  const auto scans = Wire(DriveAlong(Street(), 1, 1.7e9));
  ASSERT_THAT(robot.Begin("site", "s", scans), IsOk());

  const auto watch_call = Robot::Call();
  v1::WatchSessionRequest watch_request;
  watch_request.set_map("site");
  watch_request.set_id("s");
  const auto watch = robot.sessions().WatchSession(watch_call.get(), watch_request);
  v1::WatchSessionResponse seen;
  ASSERT_TRUE(watch->Read(&seen));
  const auto upload_call = Robot::Call();
  const auto upload = robot.Open(*upload_call, "site", "s");
  v1::UploadScansResponse response;
  ASSERT_TRUE(upload->Read(&response));

  EXPECT_EQ(daemon.End(SIGTERM), 0) << daemon.log();
  while (watch->Read(&seen)) continue;
  EXPECT_EQ(watch->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(upload->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST(Lifecycle, HealthReadinessAndReflectionAnswer) {
  const DaemonProcess daemon;
  const Robot robot(daemon.listen());
  EXPECT_EQ(HttpStatus(daemon.admin(), "/livez"), 200);
  EXPECT_EQ(HttpStatus(daemon.admin(), "/readyz"), 200);
  EXPECT_EQ(HttpStatus(daemon.admin(), "/nothing"), 404);
  // HealthCheckResponse { status: SERVING }
  EXPECT_EQ(CallBytes(robot, "/grpc.health.v1.Health/Check", ""), "\x08\x01");
  // ServerReflectionRequest { list_services: "*" }
  EXPECT_THAT(CallBytes(robot, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", "\x3a\x01*"),
              AllOf(HasSubstr("mapkeep.v1.MapService"), HasSubstr("mapkeep.v1.SessionService"),
                    HasSubstr("mapkeep.v1.TileService")));
}

TEST(Lifecycle, ASecondDaemonOnTheSameDataSaysSo) {
  const DaemonProcess daemon;
  const ProgramEnd end = RunDaemon({"--data", daemon.data(), "--listen", "127.0.0.1:0", "--admin", "127.0.0.1:0"});
  EXPECT_EQ(end.status, 1);
  EXPECT_THAT(end.output, AllOf(HasSubstr(daemon.data()), HasSubstr("another process")));
}

TEST(Lifecycle, ATakenPortIsNamed) {
  const DaemonProcess daemon;
  const TemporaryDirectory data;
  ProgramEnd end = RunDaemon({"--data", data.path(), "--listen", daemon.listen(), "--admin", "127.0.0.1:0"});
  EXPECT_EQ(end.status, 1);
  EXPECT_THAT(end.output, AllOf(HasSubstr("--listen"), HasSubstr(daemon.listen())));
  end = RunDaemon({"--data", data.path(), "--listen", "127.0.0.1:0", "--admin", daemon.admin()});
  EXPECT_EQ(end.status, 1);
  EXPECT_THAT(end.output, AllOf(HasSubstr("--admin"), HasSubstr(daemon.admin())));
}

TEST(Lifecycle, ABadConfigurationStopsTheStart) {
  const TemporaryDirectory directory;
  const std::string file = directory.path() + "/site.toml";
  std::ofstream(file) << "[align]\nmin_fitness = 2\n";
  ProgramEnd end = RunDaemon({"--config", file});
  EXPECT_EQ(end.status, 2);
  EXPECT_THAT(end.output, HasSubstr(file + ":2: align.min_fitness = 2: expected a number from 0 to 1"));
  end = RunDaemon({"--threads", "none"});
  EXPECT_EQ(end.status, 2);
  end = RunDaemon({"--help"});
  EXPECT_EQ(end.status, 0);
  EXPECT_THAT(end.output, HasSubstr("--ports-file"));
}

TEST(Lifecycle, LogLinesAreJsonIfAskedFor) {
  DaemonProcess daemon({"--log-format", "json"});
  ASSERT_EQ(daemon.End(SIGTERM), 0);
  EXPECT_THAT(daemon.log(), AllOf(HasSubstr(R"("event":"serving")"), HasSubstr(R"("event":"stopped"})")));
}

}  // namespace
}  // namespace mapkeep
