#pragma once

#include <absl/strings/str_format.h>

#include <filesystem>
#include <string>

#include "storage/map_rows.h"

namespace mapkeep {

/// A directory of this daemon's own in its data directory, for what needs a store of its own; removed at the end.
class ScratchDirectory final {
 public:
  /// `purpose` begins its name.
  ScratchDirectory(const std::string& data, const std::string& purpose)
      : path_(std::filesystem::path(data) / absl::StrFormat("%s-%016x", purpose, Random64())) {}
  ~ScratchDirectory() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  ScratchDirectory(const ScratchDirectory&) = delete;
  ScratchDirectory& operator=(const ScratchDirectory&) = delete;

  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

/// Removes those that a daemon which was killed left in its data directory. Only while no other one uses it.
inline void RemoveScratchDirectories(const std::string& data) {
  std::error_code error;
  for (const std::filesystem::directory_entry& entry : std::filesystem::directory_iterator(data, error)) {
    const std::string name = entry.path().filename().string();
    const size_t dash = name.rfind('-');
    const bool is_one = (name.starts_with("replay-") || name.starts_with("import-")) && name.size() == dash + 17 &&
                        name.find_first_not_of("0123456789abcdef", dash + 1) == std::string::npos;
    if (is_one) std::filesystem::remove_all(entry.path(), error);
  }
}

}  // namespace mapkeep
