#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <string>

namespace mapkeep {

/// "session-01" for session 0, and so on.
std::string SessionFolderName(int session);

/// Makes a folder for simulated sessions, empty of them. INVALID_ARGUMENT if it holds sessions and they are not to be
/// replaced, or (always) if it holds anything else: that is never removed.
absl::Status PrepareSessionsFolder(const std::filesystem::path& folder, bool replace);

}  // namespace mapkeep
