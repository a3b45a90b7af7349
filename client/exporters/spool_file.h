#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <string>

namespace mapkeep {

/// Bytes that are written once and read again, on disk instead of in memory, in a file without a name: it is gone with
/// the process, whatever ends that.
class SpoolFile {
 public:
  /// On the disk that holds `beside`, which will hold the result as well.
  static absl::StatusOr<SpoolFile> Create(const std::filesystem::path& beside);
  ~SpoolFile();
  SpoolFile(SpoolFile&& other) noexcept;
  SpoolFile& operator=(SpoolFile&&) = delete;

  uint64_t size() const { return size_; }

  absl::Status Append(std::string_view bytes);

  /// Fills `bytes` from `offset`; all of it must have been appended.
  absl::Status Read(uint64_t offset, char* bytes, size_t count);

 private:
  SpoolFile(int file, std::string name) : file_(file), name_(std::move(name)) {}
  absl::Status Flush();

  int file_;
  std::string name_;  ///< for errors
  std::string pending_;
  uint64_t size_ = 0;
};

}  // namespace mapkeep
