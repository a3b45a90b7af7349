#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/auth/access.h"

namespace mapkeep {

/// The file of tokens. Lines, of which empty ones and those that begin with '#' say nothing:
///
///     line   = NAME roles maps hash        separated by blanks or tabs
///     roles  = ROLE *("," ROLE)            robot, reader, operator
///     maps   = MAP *("," MAP)              a map's name, a name's beginning followed by '*', or '*': every map
///     hash   = "sha256:" 64 hex digits     SHA-256 of the token as it is sent
///
/// NAME is that of the robot or person, as in names.h; a robot's sessions carry it. A name may come on several lines
/// (the old and the new token while one is replaced); a hash may not. Tokens are 256 random bits (NewToken), so that a
/// plain hash cannot be turned back; the file should be readable by the daemon alone all the same.
class TokenTable {
 public:
  /// INVALID_ARGUMENT with "FILE:LINE" and what was expected; never the line itself.
  static absl::StatusOr<TokenTable> Parse(std::string_view text, std::string_view file);

  /// The token's caller, or nullptr. Compares with every line in the same time, whatever the token is.
  const Caller* Find(std::string_view token) const;

  size_t size() const { return entries_.size(); }

 private:
  using Digest = std::array<uint8_t, 32>;
  struct Entry {
    Digest digest;
    Caller caller;
  };
  static Digest DigestOf(std::string_view token);
  static absl::StatusOr<Entry> ParseLine(std::string_view line);

  std::vector<Entry> entries_;
};

/// A new random token, "mk_" and 43 letters: made to be shown once. UNAVAILABLE if the system has no randomness.
absl::StatusOr<std::string> NewToken();

/// The line of a token. INVALID_ARGUMENT naming what is wrong with a name, a role or a map.
absl::StatusOr<std::string> TokenLine(std::string_view name, const std::vector<std::string>& roles,
                                      const std::vector<std::string>& maps, std::string_view token);

}  // namespace mapkeep
