#pragma once

#include <absl/strings/str_cat.h>
#include <absl/strings/string_view.h>

#include <string>
#include <string_view>

namespace mapkeep {

// Debian builds Abseil with a string_view of its own; these lead from one to the other.

inline absl::string_view ToAbsl(std::string_view text) { return {text.data(), text.size()}; }
inline std::string_view FromAbsl(absl::string_view text) { return {text.data(), text.size()}; }

inline absl::string_view TextPart(std::string_view text) { return ToAbsl(text); }
inline absl::string_view TextPart(const std::string& text) { return text; }
inline absl::string_view TextPart(const char* text) { return text; }
template <typename Number>
const Number& TextPart(const Number& number) {
  return number;
}

/// absl::StrCat of strings, views and numbers.
template <typename... Parts>
std::string Text(const Parts&... parts) {
  return absl::StrCat(TextPart(parts)...);
}

}  // namespace mapkeep
