#include "server/http/request_target.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapkeep {
namespace {

std::optional<int> HexDigit(char digit) {
  if (digit >= '0' && digit <= '9') return digit - '0';
  if (digit >= 'a' && digit <= 'f') return digit - 'a' + 10;
  if (digit >= 'A' && digit <= 'F') return digit - 'A' + 10;
  return {};
}

bool IsControl(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }

// Nothing for a broken percent sign or a control character. In a query a plus is a space.
std::optional<std::string> Decoded(std::string_view text, bool is_query) {
  std::string decoded;
  for (size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      if (i + 2 >= text.size()) return {};
      const auto high = HexDigit(text[i + 1]), low = HexDigit(text[i + 2]);
      if (!high || !low) return {};
      c = static_cast<char>(*high << 4 | *low);
      i += 2;
    } else if (c == '+' && is_query) {
      c = ' ';
    }
    if (IsControl(c)) return {};
    decoded.push_back(c);
  }
  return decoded;
}

bool IsPlainSegment(const std::string& segment) {
  return !segment.empty() && segment != "." && segment != ".." && segment.find_first_of("/\\") == std::string::npos;
}

absl::Status BadTarget(const char* what) { return absl::InvalidArgumentError(absl::StrCat("request target: ", what)); }

absl::Status ParseQuery(std::string_view text, RequestTarget& target) {
  while (!text.empty()) {
    const std::string_view pair = text.substr(0, text.find('&'));
    text.remove_prefix(std::min(text.size(), pair.size() + 1));
    if (pair.empty()) continue;
    const size_t equals = pair.find('=');
    auto name = Decoded(pair.substr(0, equals), true);
    auto value = equals == std::string_view::npos ? std::string() : Decoded(pair.substr(equals + 1), true);
    if (!name || !value)
      return BadTarget("expected printable characters and percent signs with two hexadecimal digits");
    target.query.emplace(*std::move(name), *std::move(value));
  }
  return absl::OkStatus();
}

}  // namespace

std::string RequestTarget::Query(const std::string& name) const {
  const auto found = query.find(name);
  return found == query.end() ? "" : found->second;
}

absl::StatusOr<std::optional<uint64_t>> RequestTarget::QueryNumber(const std::string& name) const {
  const auto found = query.find(name);
  if (found == query.end()) return std::optional<uint64_t>();
  const auto number = WholeNumber(found->second);
  if (!number) return absl::InvalidArgumentError(absl::StrCat(name, ": expected a whole number"));
  return number;
}

absl::StatusOr<double> RequestTarget::QueryCoordinate(const std::string& name) const {
  const auto found = query.find(name);
  double number = 0;
  if (found == query.end() || !absl::SimpleAtod(found->second, &number) || !std::isfinite(number)) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": expected a number"));
  }
  return number;
}

absl::StatusOr<RequestTarget> ParseRequestTarget(std::string_view text) {
  if (text.size() > kLargestTarget) return BadTarget("it is longer than 4,096 bytes");
  if (text.empty() || text.front() != '/') return BadTarget("expected a path that begins with a slash");
  RequestTarget target;
  const size_t question = text.find('?');
  std::string_view path = text.substr(1, question == std::string_view::npos ? question : question - 1);
  while (!path.empty()) {
    const std::string_view raw = path.substr(0, path.find('/'));
    path.remove_prefix(std::min(path.size(), raw.size() + 1));
    auto segment = Decoded(raw, false);
    if (!segment) return BadTarget("expected printable characters and percent signs with two hexadecimal digits");
    if (!IsPlainSegment(*segment)) return BadTarget("expected names between single slashes, and no . or .. among them");
    target.path.push_back(*std::move(segment));
  }
  if (question != std::string_view::npos) {
    if (absl::Status status = ParseQuery(text.substr(question + 1), target); !status.ok()) return status;
  }
  return target;
}

std::optional<uint64_t> WholeNumber(std::string_view text) {
  const bool digits = !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
  uint64_t number = 0;
  if (!digits || (text.size() > 1 && text.front() == '0') || !absl::SimpleAtoi(std::string(text), &number)) return {};
  return number;
}

}  // namespace mapkeep
