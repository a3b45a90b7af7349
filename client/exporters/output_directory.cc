#include "client/exporters/output_directory.h"

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include <system_error>
#include <utility>

namespace mapkeep {

namespace fs = std::filesystem;

absl::StatusOr<OutputDirectory> OutputDirectory::Create(const fs::path& path) {
  // "name/" and "name" are one directory.
  const fs::path named = path.has_filename() ? path : path.parent_path();
  std::error_code error;
  if (fs::exists(named, error) && !(fs::is_directory(named, error) && fs::is_empty(named, error))) {
    return absl::FailedPreconditionError(absl::StrCat(path.string(), ": is there already: expected a new directory"));
  }
  fs::path temporary = named;
  temporary += absl::StrCat(".", getpid(), ".partial");
  fs::create_directories(temporary, error);
  if (error) {
    return absl::FailedPreconditionError(absl::StrCat(path.string(), ": cannot be made: ", error.message()));
  }
  return OutputDirectory(named, std::move(temporary));
}

OutputDirectory::OutputDirectory(OutputDirectory&& other) noexcept
    : path_(std::move(other.path_)), temporary_(std::exchange(other.temporary_, {})) {}

OutputDirectory::~OutputDirectory() {
  if (temporary_.empty()) return;
  std::error_code ignored;
  fs::remove_all(temporary_, ignored);
}

absl::Status OutputDirectory::Finish() {
  std::error_code error;
  fs::rename(temporary_, path_, error);  // over an empty directory, too
  if (error) return absl::UnknownError(absl::StrCat(path_.string(), ": cannot be made: ", error.message()));
  temporary_.clear();
  return absl::OkStatus();
}

}  // namespace mapkeep
