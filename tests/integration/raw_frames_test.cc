// What no gRPC library would send, and what comes of it.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/integration/daemon_process.h"
#include "tests/integration/raw_http2.h"
#include "tests/integration/robot.h"
#include "tests/integration/status_matchers.h"

namespace mapkeep {
namespace {

using raw::CallHeaders;
using raw::Frame;
using raw::kData;
using raw::kEndHeaders;
using raw::kEndStream;
using raw::kHeaders;
using ::testing::HasSubstr;

// Sends the bytes and gives what the daemon answers until it closes, says `until`, or ten seconds pass in silence.
std::string Exchange(const std::string& address, const std::string& bytes, const std::string& until) {
  const raw::Connection connection(address);
  EXPECT_TRUE(connection.open());
  connection.Send(bytes);
  return connection.Receive(until, 10);
}

const std::string kPreface = raw::Preface();

TEST(RawFrames, AClaimOfThreeGibibytesTakesNoMemoryAndEndsWithItsStream) {
  const DaemonProcess daemon;
  const std::string claim = std::string{0, static_cast<char>(0xc0), 0, 0, 0} + "x";  // not compressed; the length
  const std::string answer =
      Exchange(daemon.listen(),
               kPreface + Frame(kHeaders, kEndHeaders, 1, CallHeaders("/mapkeep.v1.SessionService/UploadScans")) +
                   Frame(kData, kEndStream, 1, claim),
               "grpc-status");
  EXPECT_THAT(answer, HasSubstr("grpc-status"));
  EXPECT_THAT(Robot(daemon.listen()).CreateMap("after"), IsOk());
}

TEST(RawFrames, GarbageEndsItsConnectionAndNothingElse) {
  const DaemonProcess daemon;
  Robot robot(daemon.listen());
  ASSERT_THAT(robot.CreateMap("before"), IsOk());
  Exchange(daemon.listen(), "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n", "");
  Exchange(daemon.listen(), kPreface + std::string(1000, '\xff'), "");
  Exchange(daemon.listen(),
           kPreface + Frame(kHeaders, kEndHeaders, 1, CallHeaders("/mapkeep.v1.MapService/CreateMap")) +
               Frame(kData, kEndStream, 1, std::string{0, 0, 0, 0, 4} + "\xff\xff\xff\xff"),
           "grpc-status");
  v1::Map map;
  EXPECT_THAT(robot.GetMap("before", map), IsOk());
}

}  // namespace
}  // namespace mapkeep
