#pragma once

#include <absl/status/statusor.h>
#include <absl/strings/escaping.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

namespace mapkeep {

/// Entries of a page: 0 asks for 100, and 1,000 is the most.
inline size_t PageSize(uint32_t asked) { return asked == 0 ? 100 : std::min<size_t>(asked, 1000); }

/// A position in a listing as a token for clients, which are not to look inside.
inline std::string PageToken(const std::string& position) { return absl::WebSafeBase64Escape(position); }

/// The position of a token; empty for the first page. INVALID_ARGUMENT if it never was a token.
inline absl::StatusOr<std::string> PositionOf(const std::string& token) {
  std::string position;
  if (!absl::WebSafeBase64Unescape(token, &position)) {
    return absl::InvalidArgumentError("page_token: expected one from an earlier answer");
  }
  return position;
}

}  // namespace mapkeep
