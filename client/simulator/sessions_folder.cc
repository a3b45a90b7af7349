#include "client/simulator/sessions_folder.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <system_error>
#include <vector>

namespace mapkeep {
namespace {

namespace fs = std::filesystem;

constexpr char kPrefix[] = "session-";

/// Whether an entry is a session, or what an interrupted run left of one.
bool IsSession(const fs::path& entry) {
  const std::string name = entry.filename().string();
  return name.rfind(kPrefix, 0) == 0 || name.rfind(absl::StrCat(".", kPrefix), 0) == 0;
}

}  // namespace

std::string SessionFolderName(int session) { return absl::StrFormat("%s%02d", kPrefix, session + 1); }

absl::Status PrepareSessionsFolder(const fs::path& folder, bool replace) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return absl::FailedPreconditionError(absl::StrCat(folder.string(), ": cannot be made: ", error.message()));
  std::vector<fs::path> sessions;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (!IsSession(entry.path())) {
      return absl::InvalidArgumentError(absl::StrCat(folder.string(), ": holds ", entry.path().filename().string(),
                                                     ", which is no simulated session: expected an empty directory"));
    }
    sessions.push_back(entry.path());
  }
  if (error) return absl::InvalidArgumentError(absl::StrCat(folder.string(), ": ", error.message()));
  if (!sessions.empty() && !replace) {
    return absl::InvalidArgumentError(
        absl::StrCat(folder.string(), ": is not empty (--force replaces the sessions in it)"));
  }
  for (const fs::path& path : sessions) {
    fs::remove_all(path, error);
    if (error) {
      return absl::FailedPreconditionError(absl::StrCat(path.string(), ": cannot be removed: ", error.message()));
    }
  }
  return absl::OkStatus();
}

}  // namespace mapkeep
