#include "tests/integration/test_certificates.h"

#include <cstdlib>
#include <ctime>
#include <fstream>
#include <stdexcept>
#include <utility>

namespace mapkeep {
namespace {

void Run(const std::string& command) {
  if (std::system((command + " >/dev/null 2>&1").c_str()) != 0) throw std::runtime_error("failed: " + command);
}

// As `openssl ca` takes it: YYMMDDHHMMSSZ.
std::string InDays(int days) {
  const std::time_t then = std::time(nullptr) + days * 86400;
  std::tm utc{};
  gmtime_r(&then, &utc);
  char text[16];
  std::strftime(text, sizeof text, "%y%m%d%H%M%SZ", &utc);
  return text;
}

}  // namespace

TestCertificates::TestCertificates(std::string directory) : directory_(std::move(directory)) { MakeAuthority("ca"); }

void TestCertificates::MakeAuthority(const std::string& name) const {
  Run("openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 3 -subj /CN=mapkeep-test-" +
      name + " -keyout " + key(name) + " -out " + certificate(name));
}

void TestCertificates::Issue(const std::string& name, int days) const { Sign(name, "ca", days); }

void TestCertificates::IssueByStranger(const std::string& name) const {
  MakeAuthority("stranger");
  Sign(name, "stranger", 2);
}

void TestCertificates::Sign(const std::string& name, const std::string& authority, int days) const {
  const std::string work = directory_ + "/" + name + ".work";
  Run("mkdir -p " + work);
  std::ofstream(work + "/config") << "[ca]\ndefault_ca=d\n[d]\ndir=" << work << "\nnew_certs_dir=" << work
                                  << "\ndatabase=" << work << "/index\nrand_serial=yes\ndefault_md=sha256\npolicy=p\n"
                                  << "unique_subject=no\n[p]\ncommonName=supplied\n[e]\n"
                                  << "subjectAltName=DNS:localhost,IP:127.0.0.1\n";
  std::ofstream(work + "/index").flush();
  Run("openssl req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj /CN=" + name + " -keyout " + work +
      "/key -out " + work + "/request");
  Run("openssl ca -batch -notext -config " + work + "/config -extensions e -cert " + certificate(authority) +
      " -keyfile " + key(authority) + " -startdate " + InDays(days < 0 ? days - 2 : -1) + " -enddate " + InDays(days) +
      " -in " + work + "/request -out " + work + "/pem");
  // In one step each, as those who renew certificates do.
  Run("mv " + work + "/key " + key(name));
  Run("mv " + work + "/pem " + certificate(name));
}

}  // namespace mapkeep
