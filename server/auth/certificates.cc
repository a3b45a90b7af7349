#include "server/auth/certificates.h"

#include <absl/strings/str_cat.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <sys/stat.h>

#include <cstdio>
#include <ctime>
#include <utility>
#include <vector>

namespace mapkeep {
namespace {

template <auto kFree>
struct Freed {
  template <typename T>
  void operator()(T* held) const {
    kFree(held);
  }
};
using Certificate = std::unique_ptr<X509, Freed<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freed<EVP_PKEY_free>>;
using File = std::unique_ptr<FILE, Freed<std::fclose>>;

std::string Stamp(const std::string& file) {
  struct stat found {};
  if (stat(file.c_str(), &found) != 0) return "";
  return absl::StrCat(found.st_ino, " ", found.st_size, " ", found.st_mtim.tv_sec, " ", found.st_mtim.tv_nsec);
}

absl::Status Unusable(const std::string& file, const char* what) {
  ERR_clear_error();
  return absl::InvalidArgumentError(absl::StrCat(file, ": ", what));
}

}  // namespace

struct Certificates::Pair {
  std::vector<Certificate> chain;  // the daemon's own first
  Key key;
  double expiry = 0;

  static absl::StatusOr<std::shared_ptr<const Pair>> Read(const std::string& certificate, const std::string& key) {
    auto pair = std::make_shared<Pair>();
    const File certificates(std::fopen(certificate.c_str(), "r"));
    if (!certificates) return Unusable(certificate, "cannot be read");
    while (X509* next = PEM_read_X509(certificates.get(), nullptr, nullptr, nullptr)) pair->chain.emplace_back(next);
    ERR_clear_error();  // that of the file's end
    if (pair->chain.empty()) return Unusable(certificate, "holds no certificate in PEM");
    const File keys(std::fopen(key.c_str(), "r"));
    if (!keys) return Unusable(key, "cannot be read");
    // A key with a password would ask for it on the terminal; this says no.
    const auto no_password = [](char*, int, int, void*) { return -1; };
    pair->key.reset(PEM_read_PrivateKey(keys.get(), nullptr, no_password, nullptr));
    if (!pair->key) return Unusable(key, "holds no private key in PEM without a password");
    if (X509_check_private_key(pair->chain.front().get(), pair->key.get()) != 1) {
      return Unusable(key, absl::StrCat("is not the key of ", certificate).c_str());
    }
    std::tm expires{};
    if (ASN1_TIME_to_tm(X509_get0_notAfter(pair->chain.front().get()), &expires) == 1) {
      pair->expiry = static_cast<double>(timegm(&expires));
    }
    return pair;
  }
};

namespace {

int ShowNewest(SSL* connection, void* certificates) {
  const auto pair = static_cast<const Certificates*>(certificates)->newest();
  SSL_certs_clear(connection);
  if (SSL_use_certificate(connection, pair->chain.front().get()) != 1) return 0;
  if (SSL_use_PrivateKey(connection, pair->key.get()) != 1) return 0;
  for (size_t i = 1; i < pair->chain.size(); ++i) {
    if (SSL_add1_chain_cert(connection, pair->chain[i].get()) != 1) return 0;
  }
  return 1;
}

}  // namespace

Certificates::Certificates(std::string certificate, std::string key)
    : certificate_(std::move(certificate)), key_(std::move(key)) {}

Certificates::~Certificates() = default;

std::string Certificates::StampNow() const { return absl::StrCat(Stamp(certificate_), "/", Stamp(key_)); }

absl::StatusOr<std::unique_ptr<Certificates>> Certificates::Open(const std::string& certificate,
                                                                 const std::string& key) {
  std::unique_ptr<Certificates> certificates(new Certificates(certificate, key));
  certificates->stamp_ = certificates->StampNow();
  auto pair = Pair::Read(certificate, key);
  if (!pair.ok()) return pair.status();
  certificates->newest_ = *std::move(pair);
  return certificates;
}

absl::StatusOr<bool> Certificates::Reload() {
  const std::string stamp = StampNow();
  {
    const std::lock_guard lock(mutex_);
    if (stamp == stamp_) return false;
    stamp_ = stamp;
  }
  auto pair = Pair::Read(certificate_, key_);
  if (!pair.ok()) return pair.status();
  const std::lock_guard lock(mutex_);
  newest_ = *std::move(pair);
  return true;
}

void Certificates::Serve(SSL_CTX* context) const {
  SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION);
  SSL_CTX_set_cert_cb(context, ShowNewest, const_cast<Certificates*>(this));  // the callback only reads
}

double Certificates::expiry() const { return newest()->expiry; }

std::shared_ptr<const Certificates::Pair> Certificates::newest() const {
  const std::lock_guard lock(mutex_);
  return newest_;
}

}  // namespace mapkeep
