#include "server/names.h"

#include <absl/strings/ascii.h>
#include <absl/strings/escaping.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <string>

namespace mapkeep {
namespace {

constexpr size_t kLongestName = 128;

bool IsNameCharacter(char c) { return absl::ascii_isalnum(c) || c == '.' || c == '_' || c == ':' || c == '-'; }

// What came from outside, fit for a message.
std::string Shown(std::string_view text, size_t longest) {
  return absl::CHexEscape(std::string(text.substr(0, longest)));
}

}  // namespace

absl::Status CheckName(std::string_view what, std::string_view name) {
  if (!name.empty() && name.size() <= kLongestName && absl::ascii_isalnum(name.front()) &&
      std::ranges::all_of(name, IsNameCharacter)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrFormat("%s \"%s\": expected 1 to %d letters, digits, '.', '_', ':' or '-', beginning with a letter or "
                      "digit",
                      what, Shown(name, kLongestName), kLongestName));
}

absl::Status CheckOptionalName(std::string_view what, std::string_view name) {
  return name.empty() ? absl::OkStatus() : CheckName(what, name);
}

absl::Status CheckCrs(std::string_view crs) {
  constexpr std::string_view kPrefix = "EPSG:";
  if (crs.empty()) return absl::OkStatus();
  const std::string_view digits = crs.starts_with(kPrefix) ? crs.substr(kPrefix.size()) : std::string_view();
  if (!digits.empty() && digits.size() <= 6 && std::ranges::all_of(digits, absl::ascii_isdigit)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrFormat("crs \"%s\": expected EPSG:N, as in EPSG:25832", Shown(crs, 64)));
}

}  // namespace mapkeep
