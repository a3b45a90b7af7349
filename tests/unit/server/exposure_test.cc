#include "server/exposure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace mapkeep {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

Config On(const std::string& host) {
  Config config;
  config.listen.host = host;
  return config;
}

TEST(Exposure, LoopbackIsWhatOnlyThisMachineReaches) {
  for (const char* host : {"127.0.0.1", "127.8.9.10", "::1", "localhost", "::ffff:127.0.0.1"}) {
    EXPECT_TRUE(IsLoopback(host)) << host;
  }
  for (const char* host : {"0.0.0.0", "::", "10.0.0.1", "128.0.0.1", "127.0.0.1.example.org", "maps.local", ""}) {
    EXPECT_FALSE(IsLoopback(host)) << host;
  }
}

TEST(Exposure, ADaemonForThisMachineNeedsNothing) { EXPECT_TRUE(CheckExposure(Config()).ok()); }

TEST(Exposure, OtherMachinesNeedTlsAndTokensOrAnExplicitNo) {
  Config config = On("0.0.0.0");
  EXPECT_THAT(std::string(CheckExposure(config).message()),
              AllOf(HasSubstr("--listen 0.0.0.0:7443"), HasSubstr("TLS (--tls-cert, --tls-key) and tokens (--tokens)"),
                    HasSubstr("--insecure")));
  config.security = {.tls_cert = "c", .tls_key = "k"};
  EXPECT_THAT(std::string(CheckExposure(config).message()), HasSubstr("needs tokens (--tokens);"));
  config.security = {.tls_cert = "c", .tls_key = "k", .tokens = "t"};
  EXPECT_TRUE(CheckExposure(config).ok());
  config.security = {.tokens = "t"};
  EXPECT_THAT(std::string(CheckExposure(config).message()), HasSubstr("needs TLS (--tls-cert, --tls-key);"));
  config.security.insecure = true;
  EXPECT_TRUE(CheckExposure(config).ok());
}

TEST(Exposure, TheRuleHoldsForEveryListener) {
  Config config;
  config.admin = {"10.0.0.1", 7444};
  EXPECT_THAT(std::string(CheckExposure(config).message()), HasSubstr("--admin 10.0.0.1:7444"));
  config.admin = {"127.0.0.1", 7444};
  config.http = {"::", 8080};
  EXPECT_THAT(std::string(CheckExposure(config).message()), HasSubstr("--http [::]:8080"));
}

TEST(Exposure, HalfACertificateIsNone) {
  Config config;
  config.security = {.tls_cert = "c"};
  EXPECT_THAT(std::string(CheckExposure(config).message()), HasSubstr("--tls-cert is given without --tls-key"));
  config.security = {.tls_key = "k"};
  EXPECT_THAT(std::string(CheckExposure(config).message()), HasSubstr("--tls-key is given without --tls-cert"));
  config.security = {.tls_client_ca = "a"};
  EXPECT_THAT(std::string(CheckExposure(config).message()), HasSubstr("--tls-client-ca"));
}

}  // namespace
}  // namespace mapkeep
