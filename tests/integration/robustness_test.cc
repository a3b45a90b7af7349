// Peers that are slow, silent, greedy or many: memory stays bounded, and nobody else notices.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "tests/integration/any_call.h"
#include "tests/integration/daemon_process.h"
#include "tests/integration/http_status.h"
#include "tests/integration/raw_http2.h"
#include "tests/integration/robot.h"
#include "tests/integration/status_matchers.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

constexpr char kUploadScans[] = "/mapkeep.v1.SessionService/UploadScans";
constexpr double kMiB = 1 << 20;

// A value that the daemon tells of itself.
double Metric(const DaemonProcess& daemon, const std::string& name) {
  const std::string text = HttpGet(daemon.admin(), "/metrics").body;
  const size_t at = text.find("\n" + name + " ");
  return at == std::string::npos ? -1 : std::strtod(text.c_str() + at + name.size() + 2, nullptr);
}

double ResidentMiB(const DaemonProcess& daemon) { return Metric(daemon, "mapkeep_process_resident_bytes") / kMiB; }

class ConfigFile {
 public:
  explicit ConfigFile(const std::string& text) { std::ofstream(path()) << text; }
  std::string path() const { return directory_.path() + "/mapkeepd.toml"; }

 private:
  const TemporaryDirectory directory_;
};

// Looks until it holds, for at most half a minute.
template <typename Condition>
bool Eventually(const Condition& condition) {
  for (int glance = 0; glance < 300; ++glance) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  return false;
}

std::vector<WireScan> SomeScans(int count) { return Wire(DriveAlong(Street(), count, 1.7e9)); }

std::string OpenUpload(const std::string& session) {
  v1::UploadScansRequest open;
  open.mutable_open()->set_map("site");
  open.mutable_open()->set_id(session);
  return raw::Message(open.SerializeAsString());
}

TEST(Robustness, ReadersThatDoNotReadHoldLittleAndHinderNobody) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("site"), IsOk());
  ASSERT_THAT(robot.UploadDrive("site", "s", DriveAlong(Street(), 12, 1.7e9)), IsOk());
  ASSERT_EQ(robot.Watch("site", "s").state(), v1::SESSION_STATE_COMMITTED);
  const std::string content = BytesOf(robot.Tiles("site", true));
  ASSERT_GT(content.size(), 100'000U);
  const double before = ResidentMiB(daemon);

  v1::StreamTilesRequest request;
  request.set_map("site");
  request.set_include_all(true);
  std::vector<std::unique_ptr<Robot>> robots;
  std::vector<std::unique_ptr<grpc::ClientContext>> calls;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::StreamTilesResponse>>> streams;
  for (int i = 0; i < 100; ++i) {
    robots.push_back(std::make_unique<Robot>(daemon.listen()));
    calls.push_back(Robot::Call());
    streams.push_back(robots.back()->tiles().StreamTiles(calls.back().get(), request));
  }
  for (int i = 0; i < 5; ++i) EXPECT_EQ(BytesOf(robot.Tiles("site", true)), content);
  EXPECT_LT(ResidentMiB(daemon) - before, 200);
  for (auto& stream : streams) {
    v1::StreamTilesResponse response;
    while (stream->Read(&response)) continue;
    EXPECT_THAT(stream->Finish(), IsOk());
  }
}

TEST(Robustness, APeerThatFellSilentLosesItsUploadAndTheRobotMayGoOn) {
  const ConfigFile config("[limits]\nkeepalive_seconds = 1\n");
  const DaemonProcess daemon({"--config", config.path()});
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("site"), IsOk());
  const auto scans = SomeScans(2);
  ASSERT_THAT(robot.Begin("site", "s", scans), IsOk());
  // Opens an upload, then neither reads nor answers nor closes, as after a cut cable.
  const raw::Connection silent(daemon.listen());
  silent.Send(raw::Preface() + raw::Frame(raw::kHeaders, raw::kEndHeaders, 1, raw::CallHeaders(kUploadScans)) +
              raw::Frame(raw::kData, 0, 1, OpenUpload("s")));
  ASSERT_TRUE(Eventually([&] { return Metric(daemon, "mapkeep_uploads_open") == 1; }));
  EXPECT_EQ(robot.Send("site", "s", scans).error_code(), grpc::StatusCode::ABORTED);
  EXPECT_TRUE(Eventually([&] { return Metric(daemon, "mapkeep_uploads_open") == 0; }));
  EXPECT_THAT(robot.Send("site", "s", scans), IsOk());
}

TEST(Robustness, OneByteAtATimeIsAnUploadLikeAnyOther) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("site"), IsOk());
  const auto scans = SomeScans(2);
  ASSERT_THAT(robot.Begin("site", "slow", scans), IsOk());
  const raw::Connection slow(daemon.listen());
  slow.Send(raw::Preface() + raw::Frame(raw::kHeaders, raw::kEndHeaders, 1, raw::CallHeaders(kUploadScans)));
  // Byte by byte, and meanwhile others come and go.
  for (const char byte : OpenUpload("slow")) {
    slow.Send(raw::Frame(raw::kData, 0, 1, std::string(1, byte)));
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_TRUE(Eventually([&] { return Metric(daemon, "mapkeep_uploads_open") == 1; }));
  for (int i = 0; i < 3; ++i) {
    ASSERT_THAT(robot.Begin("site", "quick" + std::to_string(i), scans), IsOk());
    EXPECT_THAT(robot.Send("site", "quick" + std::to_string(i), scans), IsOk());
  }
}

TEST(Robustness, TenThousandConnectionsWithoutACallTakeLittleAndGo) {
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = files.rlim_max;
  setrlimit(RLIMIT_NOFILE, &files);  // the daemon inherits it
  const size_t wanted = std::min<size_t>(10'000, files.rlim_max > 2000 ? files.rlim_max - 1000 : 1000);
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("site"), IsOk());
  const double memory = ResidentMiB(daemon), open_files = Metric(daemon, "mapkeep_process_open_files");
  {
    std::vector<raw::Connection> connections;
    connections.reserve(wanted);
    for (size_t i = 0; i < wanted; ++i) connections.emplace_back(daemon.listen());
    const auto opened = std::ranges::count_if(connections, &raw::Connection::open);
    EXPECT_EQ(static_cast<size_t>(opened), wanted);
    v1::Map map;
    for (int i = 0; i < 10; ++i) {
      EXPECT_THAT(Robot(daemon.listen()).GetMap("site", map), IsOk()) << "a newcomer gets in";
      EXPECT_EQ(HttpStatus(daemon.admin(), "/readyz"), 200);
    }
    EXPECT_LT(ResidentMiB(daemon) - memory, 512);
    RecordProperty("mebibytes", static_cast<int>(ResidentMiB(daemon) - memory));
  }
  EXPECT_TRUE(Eventually([&] { return Metric(daemon, "mapkeep_process_open_files") < open_files + 20; }));
  EXPECT_THAT(robot.CreateMap("after"), IsOk());
}

TEST(Robustness, LargestMessagesAreRefusedByNameAndTakeNoMoreThanTheirOwnMemory) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("site"), IsOk());
  const double before = ResidentMiB(daemon);
  const auto scans = SomeScans(2);
  std::vector<std::thread> senders;
  for (int sender = 0; sender < 4; ++sender) {
    senders.emplace_back([&, sender] {
      Robot greedy(daemon.listen());
      const std::string id = std::string("greedy-").append(std::to_string(sender));
      ASSERT_THAT(greedy.Begin("site", id, scans), IsOk());
      for (int round = 0; round < 5; ++round) {
        for (const size_t size : {size_t{7} << 20, size_t{9} << 20}) {
          const auto call = Robot::Call();
          const auto upload = greedy.Open(*call, "site", id);
          v1::UploadScansRequest request;
          request.set_chunk(std::string(size, 'x'));
          for (int i = 0; i < 4 && upload->Write(request); ++i) continue;
          const grpc::StatusCode code = Robot::End(*upload).error_code();
          // Above gRPC's limit its own code, below it ours; ABORTED while the last round's slot is being freed.
          if (code != grpc::StatusCode::ABORTED) {
            EXPECT_EQ(code,
                      size > (8 << 20) ? grpc::StatusCode::RESOURCE_EXHAUSTED : grpc::StatusCode::INVALID_ARGUMENT);
          }
        }
      }
    });
  }
  v1::Map map;
  for (int i = 0; i < 20; ++i) EXPECT_THAT(robot.GetMap("site", map), IsOk());
  for (std::thread& sender : senders) sender.join();
  EXPECT_LT(ResidentMiB(daemon) - before, 300);
  ASSERT_THAT(robot.Begin("site", "fine", scans), IsOk());
  EXPECT_THAT(robot.Send("site", "fine", scans), IsOk());
}

TEST(Robustness, ARobotOverItsQuotaIsToldWhenToComeAgainAndOthersGoOn) {
  const ConfigFile config("[quota]\nrobot_sessions = 1\nrobot_mib = 64\nrobot_jobs = 1\nretry_seconds = 7\n");
  DaemonProcess daemon({"--config", config.path()});
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("site"), IsOk());
  const auto scans = SomeScans(2);
  const auto begin = [&](const std::string& id, const std::string& name) {
    v1::BeginSessionRequest request;
    request.set_map("site");
    request.set_id(id);
    request.set_robot(name);
    for (const WireScan& scan : scans) request.add_scan_crc32c(scan.header.crc32c());
    return CallAny(ChannelTo(daemon.listen()), "/mapkeep.v1.SessionService/BeginSession", request.SerializeAsString());
  };
  EXPECT_THAT(begin("a", "r7").status, IsOk());
  for (const bool restarted : {false, true}) {
    if (restarted) {
      daemon.Kill();
      daemon.Start();
      ASSERT_TRUE(Eventually([&] { return Metric(daemon, "mapkeep_quota_sessions") == 1; })) << "found again";
    }
    const AnyAnswer refused = begin("b", "r7");
    EXPECT_THAT(refused.status, FailsWith(grpc::StatusCode::RESOURCE_EXHAUSTED, {"r7", "quota.robot_sessions", "7 s"}));
    EXPECT_EQ(refused.trailers.at("grpc-retry-pushback-ms"), "7000");
    EXPECT_THAT(refused.status.error_details(), HasSubstr("google.rpc.RetryInfo"));
    EXPECT_THAT(begin("a", "r7").status, IsOk()) << "what is begun may go on";
  }
  EXPECT_THAT(begin("c", "r8").status, IsOk()) << "others may begin";
  Robot again(daemon.listen());
  EXPECT_THAT(again.Send("site", "a", scans), IsOk());
  EXPECT_THAT(again.DeleteSession("site", "a"), IsOk());
  EXPECT_THAT(begin("b", "r7").status, IsOk()) << "there is room again";
}

TEST(Robustness, AStreamOfLargestScansIsStagedWithoutGrowing) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("site"), IsOk());
  // 60 scans of 4 MiB: 240 MiB through a daemon that may hold 32 MiB of one upload.
  Scan scan;
  for (int i = 0; i < 262'144; ++i) {
    scan.points.emplace_back(static_cast<float>(i % 512) * 0.1F, static_cast<float>(i / 512) * 0.1F, 1.0F);
    scan.intensities.push_back(0.5F);
  }
  std::vector<WireScan> scans;
  for (uint32_t i = 0; i < 60; ++i) {
    scan.time = 1.7e9 + i;
    scans.push_back(Wire(i, scan, Pose::Identity()));
  }
  const double before = ResidentMiB(daemon);
  ASSERT_THAT(robot.Begin("site", "large", scans), IsOk());
  ASSERT_THAT(robot.Send("site", "large", scans), IsOk());
  EXPECT_LT(ResidentMiB(daemon) - before, 400) << "the store's own write buffers are in there";
  EXPECT_EQ(Metric(daemon, "mapkeep_upload_pending_bytes"), 0);
  EXPECT_EQ(Metric(daemon, "mapkeep_upload_scans_total"), 60);
}

}  // namespace
}  // namespace mapkeep
