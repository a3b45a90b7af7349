// The mapkeep program itself: usage, bad input, and a server that is not there. What it does with a server is tested in
// tests/integration and tests/end_to_end.

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/unit/client/program.h"
#include "tests/unit/client/session_files.h"

namespace mapkeep {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

/// A port of this machine on which nothing listens: bound, so that nobody else takes it, but not listening.
class SilentPort {
 public:
  SilentPort() : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    EXPECT_EQ(bind(socket_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    address_ = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  }
  ~SilentPort() { close(socket_); }
  SilentPort(const SilentPort&) = delete;
  SilentPort& operator=(const SilentPort&) = delete;

  const std::string& address() const { return address_; }

 private:
  int socket_;
  std::string address_;
};

/// One line on the standard error, "mapkeep: ...", nothing on the standard output.
void ExpectError(const ProgramResult& result, int exit_code, const std::string& what) {
  EXPECT_EQ(result.exit_code, exit_code);
  EXPECT_THAT(result.error, StartsWith("mapkeep: "));
  EXPECT_THAT(result.error, HasSubstr(what));
  EXPECT_EQ(std::count(result.error.begin(), result.error.end(), '\n'), 1) << result.error;
  EXPECT_EQ(result.out, "");
}

TEST(CommandLine, HelpAndVersionEndWell) {
  EXPECT_THAT(RunMapkeep({"--version"}).out, StartsWith("mapkeep 0."));
  const ProgramResult help = RunMapkeep({"--help"});
  EXPECT_EQ(help.exit_code, 0);
  for (const char* word : {"map", "session", "export", "query", "clean", "--server", "Examples:", "Exit status"}) {
    EXPECT_THAT(help.out, HasSubstr(word));
  }
  EXPECT_EQ(RunMapkeep({"session", "upload", "--help"}).exit_code, 0);
}

TEST(CommandLine, UsageErrorsEndWithTwo) {
  const std::vector<std::vector<std::string>> bad = {
      {},
      {"nonsense"},
      {"map"},
      {"map", "create"},
      {"map", "create", "a", "b"},
      {"map", "create", "a/b"},
      {"map", "create", "-a"},
      {"map", "create", "a", "--voxel-size", "2"},
      {"map", "create", "a", "--voxel-size", "nan"},
      {"map", "create", "a", "--origin", "1,2"},
      {"map", "info", std::string(129, 'a')},
      {"session", "show", "street"},
      {"session", "upload", "street"},
      {"session", "upload", "street", "dir", "--id", "a b"},
      {"export", "street", "map.xyz"},
      {"export", "street", "map.pcd", "--box", "1,2,3,4,5"},
      {"export", "street", "map.pcd", "--box", "1,2,3,0,5,6"},
      {"query", "street", "1", "2"},
      {"query", "street", "1", "2", "x"},
      {"query", "street", "1", "2", "nan"},
      {"clean", "dir"},
      {"clean", "dir", "out", "--threads", "0"},
      {"clean", "dir", "out", "--unknown"},
  };
  for (const std::vector<std::string>& arguments : bad) {
    SCOPED_TRACE(::testing::PrintToString(arguments));
    ExpectError(RunMapkeep(arguments), 2, "");
  }
}

TEST(CommandLine, BadSessionsEndWithTwoBeforeAnyServerIsAsked) {
  const SilentPort port;
  const TemporaryDirectory directory;
  WriteKittiSession(directory.path(), 3);
  const auto upload = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"session", "upload", "street", directory.path(), "--server", port.address()});
    return RunMapkeep(more);
  };
  ExpectError(upload({"--frames", "0:3"}), 2, "frame 3 is beyond the last one, 2");
  ExpectError(upload({"--frames", "x"}), 2, "expected FIRST:LAST");
  ExpectError(upload({"--format", "bagpipe"}), 2, "no session layout is called 'bagpipe'");
  ExpectError(upload({"--format", "elite"}), 2, "Scans: ");
  WriteText(directory.path() / "velodyne/000002.bin", "seventeen bytes..");
  const ProgramResult truncated = upload({"--json"});
  ExpectError(truncated, 2, "velodyne/000002.bin: truncated: 17 bytes");
  WriteText(directory.path() / "poses.txt", kIdentityRow + "1 0 0\n" + kIdentityRow);
  ExpectError(upload({}), 2, "poses.txt:2: 3 numbers where 12 are expected");
  ExpectError(RunMapkeep({"session", "upload", "street", "/nowhere"}), 2, "/nowhere: no such file or directory");
  ExpectError(RunMapkeep({"clean", "/nowhere", directory.path() / "out"}), 2, "/nowhere: no such file or directory");
}

TEST(CommandLine, AServerThatIsNotThereIsAFailureNamingItsAddress) {
  const SilentPort port;
  for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
           {"map", "list"}, {"session", "watch", "street", "one"}, {"export", "street", "/tmp/never-written.pcd"}}) {
    SCOPED_TRACE(::testing::PrintToString(arguments));
    ExpectError(RunMapkeep(arguments, {"MAPKEEP_SERVER=" + port.address()}), 1,
                "no mapkeepd answers at " + port.address());
  }
}

TEST(CommandLine, TheServerOptionWinsOverTheEnvironmentAndMayStandAnywhere) {
  const SilentPort port, other;
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"--server", port.address(), "--json", "map", "list"},
                                             {"map", "list", "--json", "--server", port.address()}}) {
    SCOPED_TRACE(::testing::PrintToString(arguments));
    ExpectError(RunMapkeep(arguments, {"MAPKEEP_SERVER=" + other.address()}), 1, port.address());
  }
}

}  // namespace
}  // namespace mapkeep
