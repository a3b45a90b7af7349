#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>

namespace mapkeep {

/// A directory that appears whole or not at all: filled under a temporary name beside its own, renamed at the end, and
/// removed if that is never reached.
class OutputDirectory {
 public:
  /// FAILED_PRECONDITION naming it if it cannot be made, or if something is there that is not an empty directory.
  static absl::StatusOr<OutputDirectory> Create(const std::filesystem::path& path);
  ~OutputDirectory();
  OutputDirectory(OutputDirectory&& other) noexcept;
  OutputDirectory& operator=(OutputDirectory&&) = delete;

  /// Where to write meanwhile.
  const std::filesystem::path& path() const { return temporary_; }

  /// Gives the directory its name.
  absl::Status Finish();

 private:
  OutputDirectory(std::filesystem::path path, std::filesystem::path temporary)
      : path_(std::move(path)), temporary_(std::move(temporary)) {}

  std::filesystem::path path_;
  std::filesystem::path temporary_;  ///< empty: nothing to remove
};

}  // namespace mapkeep
