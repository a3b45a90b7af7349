#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapkeep {

/// What a request asks for: "/v1/maps/yard?limit=3" is {"v1", "maps", "yard"} with limit = "3".
struct RequestTarget {
  std::vector<std::string> path;             ///< decoded segments; none for "/"
  std::map<std::string, std::string> query;  ///< decoded; the first of equal names

  /// The value of a query parameter, or empty.
  std::string Query(const std::string& name) const;
  /// A whole number in decimal; nothing if it is not there. INVALID_ARGUMENT naming it for anything else.
  absl::StatusOr<std::optional<uint64_t>> QueryNumber(const std::string& name) const;
  /// A finite number. INVALID_ARGUMENT naming it for anything else, also if it is not there.
  absl::StatusOr<double> QueryCoordinate(const std::string& name) const;
};

inline constexpr size_t kLargestTarget = 4096;  ///< bytes

/// INVALID_ARGUMENT for anything but an absolute path of plain segments: no empty one but the last, no "." or "..", no
/// broken percent sign, no control character, slash or backslash behind one, nothing longer than kLargestTarget.
absl::StatusOr<RequestTarget> ParseRequestTarget(std::string_view target);

/// A whole number in decimal, without sign or leading zeros; nothing for anything else.
std::optional<uint64_t> WholeNumber(std::string_view text);

}  // namespace mapkeep
