// What no gRPC library would send: HTTP/2 frames by hand (RFC 9113), headers as HPACK literals (RFC 7541, 6.2.2).

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <string>

#include "tests/integration/daemon_process.h"
#include "tests/integration/robot.h"
#include "tests/integration/status_matchers.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;

constexpr char kData = 0, kHeaders = 1, kSettings = 4;
constexpr char kEndHeaders = 4, kEndStream = 1;

std::string Frame(char type, char flags, char stream, const std::string& payload) {
  const auto byte = [&](int shift) { return static_cast<char>(payload.size() >> shift & 0xff); };
  return std::string{byte(16), byte(8), byte(0), type, flags, 0, 0, 0, stream} + payload;
}

std::string Literal(const std::string& name, const std::string& value) {
  return std::string(1, '\0') + static_cast<char>(name.size()) + name + static_cast<char>(value.size()) + value;
}

std::string CallHeaders(const std::string& path) {
  return Literal(":method", "POST") + Literal(":scheme", "http") + Literal(":path", path) +
         Literal(":authority", "localhost") + Literal("te", "trailers") + Literal("content-type", "application/grpc");
}

// Sends the bytes and gives what the daemon answers until it closes, says `until`, or ten seconds pass in silence.
std::string Exchange(const std::string& address, const std::string& bytes, const std::string& until) {
  const int connection = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in to{.sin_family = AF_INET};
  to.sin_port = htons(static_cast<uint16_t>(std::atoi(address.substr(address.rfind(':') + 1).c_str())));
  inet_pton(AF_INET, "127.0.0.1", &to.sin_addr);
  EXPECT_EQ(connect(connection, reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
  const timeval patience{.tv_sec = 10};
  setsockopt(connection, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  send(connection, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  std::string answer;
  char buffer[4096];
  while (until.empty() || answer.find(until) == std::string::npos) {
    const ssize_t count = recv(connection, buffer, sizeof buffer, 0);
    if (count <= 0) break;
    answer.append(buffer, count);
  }
  close(connection);
  return answer;
}

const std::string kPreface = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + Frame(kSettings, 0, 0, "");

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
