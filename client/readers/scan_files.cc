#include "client/readers/scan_files.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <string>
#include <system_error>
#include <tuple>

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

/// Sorts numbers by value without overflow: fewer digits first, then digit by digit.
std::tuple<bool, size_t, std::string, std::string> OrderOf(const fs::path& file) {
  const std::string stem = file.stem().string();
  if (!std::all_of(stem.begin(), stem.end(), absl::ascii_isdigit)) return {true, 0, stem, stem};
  const std::string digits = stem.substr(std::min(stem.find_first_not_of('0'), stem.size()));
  return {false, digits.size(), digits, stem};
}

}  // namespace

absl::StatusOr<std::vector<fs::path>> ListScanFiles(const fs::path& folder, std::string_view extension) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    if (entry->path().extension() == extension) files.push_back(entry->path());
  }
  if (error) return absl::NotFoundError(absl::StrCat(folder.string(), ": ", error.message()));
  if (files.empty()) return absl::NotFoundError(absl::StrFormat("%s: holds no *%s scans", folder.string(), extension));
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) { return OrderOf(a) < OrderOf(b); });
  return files;
}

}  // namespace mapkeep
