#include "client/exporters/output_file.h"

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

namespace mapkeep {

namespace fs = std::filesystem;

absl::StatusOr<OutputFile> OutputFile::Create(const fs::path& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) {
    return absl::FailedPreconditionError(absl::StrCat(path.string(), ": is a directory"));
  }
  // The process id keeps two exports to one name apart; the last to finish wins.
  fs::path temporary = path;
  temporary += absl::StrCat(".", getpid(), ".partial");
  errno = 0;
  auto stream = std::make_unique<std::ofstream>(temporary, std::ios::binary | std::ios::trunc);
  if (!*stream) {
    return absl::FailedPreconditionError(absl::StrCat(path.string(), ": cannot be written: ", std::strerror(errno)));
  }
  return OutputFile(path, std::move(temporary), std::move(stream));
}

OutputFile::OutputFile(fs::path path, fs::path temporary, std::unique_ptr<std::ofstream> stream)
    : path_(std::move(path)), temporary_(std::move(temporary)), stream_(std::move(stream)) {}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : path_(std::move(other.path_)),
      temporary_(std::exchange(other.temporary_, {})),
      stream_(std::move(other.stream_)) {}

OutputFile::~OutputFile() {
  if (temporary_.empty()) return;
  stream_->close();
  std::error_code ignored;
  fs::remove(temporary_, ignored);
}

absl::Status OutputFile::Finish() {
  errno = 0;
  stream_->close();
  if (!*stream_) {
    return absl::UnknownError(absl::StrCat(
        path_.string(), ": cannot be written: ", errno != 0 ? std::strerror(errno) : "the disk may be full"));
  }
  std::error_code error;
  fs::rename(temporary_, path_, error);
  if (error) return absl::UnknownError(absl::StrCat(path_.string(), ": cannot be written: ", error.message()));
  temporary_.clear();
  return absl::OkStatus();
}

}  // namespace mapkeep
