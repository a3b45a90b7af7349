// TLS and certificates of clients, with certificates that openssl makes here and now.

#include <gmock/gmock.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>

#include "tests/integration/any_call.h"
#include "tests/integration/daemon_process.h"
#include "tests/integration/http_status.h"
#include "tests/integration/status_matchers.h"
#include "tests/integration/test_certificates.h"

namespace mapkeep {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kListMaps[] = "/mapkeep.v1.MapService/ListMaps";

std::string Content(const std::string& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

class TlsTest : public ::testing::Test {
 protected:
  TlsTest() { certificates_.Issue("server"); }

  std::vector<std::string> Flags(std::vector<std::string> more = {}) const {
    more.insert(more.end(),
                {"--tls-cert", certificates_.certificate("server"), "--tls-key", certificates_.key("server")});
    return more;
  }

  // As a client with `name`'s certificate (none: empty) that trusts the authority.
  std::shared_ptr<grpc::ChannelCredentials> As(const std::string& name = "") const {
    grpc::SslCredentialsOptions options{.pem_root_certs = Content(certificates_.authority())};
    if (!name.empty()) {
      options.pem_private_key = Content(certificates_.key(name));
      options.pem_cert_chain = Content(certificates_.certificate(name));
    }
    return grpc::SslCredentials(options);
  }

  static grpc::Status List(const DaemonProcess& daemon, const std::shared_ptr<grpc::ChannelCredentials>& credentials) {
    return CallAny(ChannelTo(daemon.listen(), credentials), kListMaps, "").status;
  }

  const TemporaryDirectory directory_;
  const TestCertificates certificates_{directory_.path()};
};

TEST_F(TlsTest, EveryListenerSpeaksTlsAndNothingElse) {
  const DaemonProcess daemon(Flags());
  EXPECT_THAT(List(daemon, As()), IsOk());
  EXPECT_EQ(List(daemon, grpc::InsecureChannelCredentials()).error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(HttpGet(daemon.admin(), "/readyz", "", certificates_.authority()).status, 200);
  EXPECT_NE(HttpGet(daemon.admin(), "/readyz").status, 200);
  EXPECT_THAT(HttpGet(daemon.admin(), "/metrics", "", certificates_.authority()).body,
              HasSubstr("mapkeep_certificate_expiry_seconds"));
}

TEST_F(TlsTest, AClientThatKnowsAnotherAuthorityDoesNotTrustTheDaemon) {
  const DaemonProcess daemon(Flags());
  certificates_.IssueByStranger("other");
  const auto stranger = grpc::SslCredentials({.pem_root_certs = Content(certificates_.certificate("stranger"))});
  EXPECT_EQ(List(daemon, stranger).error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(HttpGet(daemon.admin(), "/readyz", "", certificates_.certificate("stranger")).status, -1);
}

TEST_F(TlsTest, AnExpiredCertificateIsNotTrustedAndARenewedOneIsTakenUpWithoutARestart) {
  certificates_.Issue("server", -1);
  const DaemonProcess daemon(Flags());
  EXPECT_EQ(List(daemon, As()).error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(HttpGet(daemon.admin(), "/readyz", "", certificates_.authority()).status, -1);
  certificates_.Issue("server");
  bool rpc = false, http = false;
  for (int tries = 0; tries < 100 && !(rpc && http); ++tries) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    rpc = rpc || List(daemon, As()).ok();
    http = http || HttpGet(daemon.admin(), "/readyz", "", certificates_.authority()).status == 200;
  }
  EXPECT_TRUE(rpc);
  EXPECT_TRUE(http);
  EXPECT_THAT(daemon.log(), HasSubstr("credentials read again what=certificates"));
}

TEST_F(TlsTest, WithAnAuthorityForClientsOnlyTheirCertificatesGetIn) {
  for (const char* name : {"robot", "late"}) certificates_.Issue(name, name == std::string("late") ? -1 : 2);
  certificates_.IssueByStranger("intruder");
  const DaemonProcess daemon(Flags({"--tls-client-ca", certificates_.authority()}));
  EXPECT_THAT(List(daemon, As("robot")), IsOk());
  EXPECT_EQ(List(daemon, As()).error_code(), grpc::StatusCode::UNAVAILABLE) << "no certificate";
  EXPECT_EQ(List(daemon, As("late")).error_code(), grpc::StatusCode::UNAVAILABLE) << "expired";
  EXPECT_EQ(List(daemon, As("intruder")).error_code(), grpc::StatusCode::UNAVAILABLE) << "of another authority";
  EXPECT_THAT(List(daemon, As("robot")), IsOk()) << "the others changed nothing";
}

TEST_F(TlsTest, FilesThatCannotBeUsedStopTheStartByName) {
  certificates_.Issue("other");
  ProgramEnd end =
      RunDaemon({"--data", directory_.path() + "/data", "--admin", "127.0.0.1:0", "--listen", "127.0.0.1:0",
                 "--tls-cert", certificates_.certificate("server"), "--tls-key", certificates_.key("other")});
  EXPECT_EQ(end.status, 1);
  EXPECT_THAT(end.output, AllOf(HasSubstr(certificates_.key("other")), HasSubstr("is not the key of")));
  end = RunDaemon({"--admin", "127.0.0.1:0", "--listen", "127.0.0.1:0", "--tls-cert", certificates_.key("server"),
                   "--tls-key", certificates_.key("server")});
  EXPECT_EQ(end.status, 1);
  EXPECT_THAT(end.output, HasSubstr("holds no certificate"));
  end = RunDaemon({"--admin", "127.0.0.1:0", "--listen", "127.0.0.1:0", "--tokens", directory_.path() + "/nothing"});
  EXPECT_EQ(end.status, 1);
  EXPECT_THAT(end.output, HasSubstr("/nothing: cannot be read"));
}

TEST_F(TlsTest, OtherMachinesGetNothingWithoutTlsAndTokensUnlessItIsAskedFor) {
  ProgramEnd end = RunDaemon({"--listen", "0.0.0.0:0", "--admin", "127.0.0.1:0"});
  EXPECT_EQ(end.status, 2);
  EXPECT_THAT(end.output, AllOf(HasSubstr("--listen 0.0.0.0:0"), HasSubstr("TLS"), HasSubstr("--insecure")));
  end = RunDaemon({"--listen", "127.0.0.1:0", "--admin", "0.0.0.0:0"});
  EXPECT_EQ(end.status, 2);
  EXPECT_THAT(end.output, HasSubstr("--admin 0.0.0.0:0"));
  DaemonProcess open({"--insecure"});
  EXPECT_EQ(open.End(SIGTERM), 0);
}

}  // namespace
}  // namespace mapkeep
