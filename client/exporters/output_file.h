#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <fstream>
#include <memory>

namespace mapkeep {

/// A file that appears whole or not at all: written under a temporary name beside its own, renamed at the end, and
/// removed if that is never reached. An existing file of the name stays until then.
class OutputFile {
 public:
  /// An error naming the file if it cannot be made.
  static absl::StatusOr<OutputFile> Create(const std::filesystem::path& path);
  ~OutputFile();
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;

  std::ostream& stream() { return *stream_; }

  /// Flushes and gives the file its name. An error for anything that went wrong since Create.
  absl::Status Finish();

 private:
  OutputFile(std::filesystem::path path, std::filesystem::path temporary, std::unique_ptr<std::ofstream> stream);

  std::filesystem::path path_;
  std::filesystem::path temporary_;  ///< empty: nothing to remove
  std::unique_ptr<std::ofstream> stream_;
};

}  // namespace mapkeep
