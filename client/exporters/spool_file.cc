#include "client/exporters/spool_file.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace mapkeep {
namespace {

constexpr size_t kPending = size_t{256} << 10;

}  // namespace

absl::StatusOr<SpoolFile> SpoolFile::Create(const std::filesystem::path& beside) {
  std::string name = absl::StrCat(beside.string(), ".spool-XXXXXX");
  const int file = mkostemp(name.data(), O_CLOEXEC);
  if (file < 0) {
    return absl::FailedPreconditionError(
        absl::StrCat(beside.string(), ": no file can be made beside it: ", std::strerror(errno)));
  }
  unlink(name.c_str());
  return SpoolFile(file, beside.string());
}

SpoolFile::SpoolFile(SpoolFile&& other) noexcept
    : file_(std::exchange(other.file_, -1)),
      name_(std::move(other.name_)),
      pending_(std::move(other.pending_)),
      size_(other.size_) {}

SpoolFile::~SpoolFile() {
  if (file_ >= 0) close(file_);
}

absl::Status SpoolFile::Append(std::string_view bytes) {
  pending_.append(bytes);
  size_ += bytes.size();
  return pending_.size() < kPending ? absl::OkStatus() : Flush();
}

absl::Status SpoolFile::Flush() {
  for (std::string_view rest = pending_; !rest.empty();) {
    const ssize_t written = write(file_, rest.data(), rest.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      return absl::UnknownError(
          absl::StrCat(name_, ": what is kept beside it cannot be written: ", std::strerror(errno)));
    }
    rest.remove_prefix(static_cast<size_t>(written));
  }
  pending_.clear();
  return absl::OkStatus();
}

absl::Status SpoolFile::Read(uint64_t offset, char* bytes, size_t count) {
  if (absl::Status status = Flush(); !status.ok()) return status;
  while (count > 0) {
    const ssize_t got = pread(file_, bytes, count, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      return absl::UnknownError(absl::StrCat(
          name_, ": what is kept beside it cannot be read: ", got < 0 ? std::strerror(errno) : "it is too short"));
    }
    bytes += got;
    offset += static_cast<uint64_t>(got);
    count -= static_cast<size_t>(got);
  }
  return absl::OkStatus();
}

}  // namespace mapkeep
