#include "client/cli/output.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>
#include <absl/time/time.h>

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

namespace mapkeep {
namespace {

bool IsNumber(const std::string& cell) {
  return cell == "-" || std::all_of(cell.begin(), cell.end(), [](char c) {
           return absl::ascii_isdigit(static_cast<unsigned char>(c)) || c == '.' || c == '-' || c == '/';
         });
}

}  // namespace

void PrintError(const std::string& message) {
  std::cout.flush();
  std::cerr << "mapkeep: " << absl::StrReplaceAll(message, {{"\n", " "}}) << '\n';
}

ExitCode Fail(const absl::Status& status) {
  PrintError(std::string(status.message()));
  return absl::IsInvalidArgument(status) ? ExitCode::kUsage : ExitCode::kFailed;
}

ExitCode BadInput(const absl::Status& status) {
  PrintError(std::string(status.message()));
  return absl::IsCancelled(status) ? ExitCode::kFailed : ExitCode::kUsage;
}

void PrintJson(const nlohmann::json& document) { std::cout << document.dump(2) << '\n'; }

void PrintFields(const std::vector<std::pair<std::string, std::string>>& fields) {
  size_t width = 0;
  for (const auto& [name, value] : fields) width = std::max(width, name.size() + 1);
  for (const auto& [name, value] : fields) {
    std::cout << absl::StrFormat("%-*s %s\n", static_cast<int>(width), absl::StrCat(name, ":"), value);
  }
}

void PrintTable(const std::vector<std::vector<std::string>>& rows) {
  std::vector<size_t> widths(rows.front().size(), 0);
  std::vector<bool> numbers(rows.front().size(), true);
  for (size_t r = 0; r < rows.size(); ++r) {
    for (size_t c = 0; c < rows[r].size(); ++c) {
      widths[c] = std::max(widths[c], rows[r][c].size());
      if (r > 0 && !IsNumber(rows[r][c])) numbers[c] = false;
    }
  }
  for (const std::vector<std::string>& row : rows) {
    std::string line;
    for (size_t c = 0; c < row.size(); ++c) {
      const int width = static_cast<int>(widths[c]);
      absl::StrAppendFormat(&line, "%s%*s", c == 0 ? "" : "  ", numbers[c] ? width : -width, row[c]);
    }
    std::cout << absl::StripTrailingAsciiWhitespace(line) << '\n';
  }
}

std::string FormatTime(double seconds_since_1970) {
  if (seconds_since_1970 == 0) return "-";
  const absl::Time time = absl::UnixEpoch() + absl::Seconds(seconds_since_1970);
  return absl::FormatTime("%Y-%m-%d %H:%M", time, absl::UTCTimeZone());
}

}  // namespace mapkeep
