#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "server/auth/access.h"
#include "server/auth/token_table.h"

namespace mapkeep {

/// Who may do what, for every listener of the daemon: gRPC and HTTP ask the same object. Thread-safe.
///
///     const auto caller = authority.Authorize(header, Access::kRead, Scope::Map("yard"));
///     if (!caller.ok()) ...   // UNAUTHENTICATED (HTTP 401) or PERMISSION_DENIED (403); the message holds no secret
class Authority {
 public:
  /// No tokens: everybody may do everything, whatever they send.
  Authority() = default;
  /// The tokens of a file (format: token_table.h). INVALID_ARGUMENT with file and line, UNAVAILABLE if it cannot be
  /// read.
  static absl::StatusOr<std::unique_ptr<Authority>> Open(const std::string& file);

  /// Reads the file again if it changed since; true if it did. An error leaves the tokens that were read last in force
  /// and comes once for each change of the file.
  absl::StatusOr<bool> Reload();

  /// Whether callers need a token at all.
  bool has_tokens() const;

  /// Who sent `authorization`, the value of that header: "Bearer TOKEN" ("" if there is none). UNAUTHENTICATED.
  absl::StatusOr<Caller> Authenticate(std::string_view authorization) const;

  /// Authenticate, then Allow.
  absl::StatusOr<Caller> Authorize(std::string_view authorization, Access access, const Scope& scope) const;

 private:
  // What tells that a file changed; all zero: it could not be looked at.
  struct Stamp {
    uint64_t inode = 0;
    int64_t size = 0, seconds = 0, nanoseconds = 0;
    bool operator==(const Stamp&) const = default;
  };
  static Stamp StampOf(const std::string& file);
  static absl::StatusOr<std::shared_ptr<const TokenTable>> Read(const std::string& file);

  std::string file_;
  mutable std::mutex mutex_;
  Stamp stamp_;
  std::shared_ptr<const TokenTable> table_;  // nullptr: no tokens
};

}  // namespace mapkeep
