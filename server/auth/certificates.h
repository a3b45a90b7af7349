#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <mutex>
#include <string>

using SSL_CTX = struct ssl_ctx_st;

namespace mapkeep {

/// The daemon's certificate for listeners on OpenSSL (HTTP), read again when its files change. Thread-safe.
class Certificates {
 public:
  struct Pair;  ///< certificate, chain and key

  /// PEM files. INVALID_ARGUMENT naming the file that cannot be used, or both if they do not belong together.
  static absl::StatusOr<std::unique_ptr<Certificates>> Open(const std::string& certificate, const std::string& key);
  ~Certificates();

  /// Reads the files again if one of them changed; true if so. An error leaves the last pair in use, and comes once a
  /// change.
  absl::StatusOr<bool> Reload();

  /// Every later handshake of the listener shows what is newest then; TLS 1.2 or later. This outlives the context.
  void Serve(SSL_CTX* context) const;

  /// When the newest certificate expires, seconds since 1970 (UTC).
  double expiry() const;

  std::shared_ptr<const Pair> newest() const;

 private:
  Certificates(std::string certificate, std::string key);
  std::string StampNow() const;

  const std::string certificate_, key_;
  mutable std::mutex mutex_;
  std::string stamp_;
  std::shared_ptr<const Pair> newest_;
};

}  // namespace mapkeep
